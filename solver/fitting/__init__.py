# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of one frame, of many frames, and of a clip with one shape."""
