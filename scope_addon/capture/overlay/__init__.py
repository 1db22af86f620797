# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the captured bodies over the footage."""
