# SPDX-License-Identifier: GPL-3.0-or-later
"""Editing a captured motion in numpy, without bpy: smoothing, spans, floor, root motion, loops, key
reduction.
"""
