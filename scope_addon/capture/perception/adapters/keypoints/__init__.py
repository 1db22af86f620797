# SPDX-License-Identifier: GPL-3.0-or-later
"""Keypoint networks: heatmap and SimCC outputs."""
