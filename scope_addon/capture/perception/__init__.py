# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames to observations: detection, landmark and hand networks, and the lifting network."""
