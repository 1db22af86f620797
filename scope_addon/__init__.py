# SPDX-License-Identifier: GPL-3.0-or-later
"""The product around the solver: capture (video to motion), scene (motion to Blender data), ui,
command line.
"""
