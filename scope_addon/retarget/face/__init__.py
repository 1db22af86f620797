# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions on faces that bones move, free of bpy."""
