# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a clip of a person, seen from the waist up, who talks, makes faces and gestures with open
fingers.
"""
