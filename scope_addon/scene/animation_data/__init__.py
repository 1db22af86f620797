# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's animation data: actions, frame rates, and changes that are rolled back on failure."""
