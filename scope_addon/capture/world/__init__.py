# SPDX-License-Identifier: GPL-3.0-or-later
"""From body states to a motion in the world: camera path, floor, balance, and all frames
together.
"""
