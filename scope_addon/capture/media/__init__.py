# SPDX-License-Identifier: GPL-3.0-or-later
"""Footage to frames: videos, image sequences and stills, their ranges, timestamps and metadata."""
