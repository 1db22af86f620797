# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera: intrinsics, calibration, rotation from the background, Manhattan directions and
verticals.
"""
