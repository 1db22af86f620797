# SPDX-License-Identifier: GPL-3.0-or-later
"""Retargeting in numpy: mapping a rig's bones to body parts and transferring the body's motion to
them, and motion files of other tools as motions of one of our bodies.
"""
