# SPDX-License-Identifier: GPL-3.0-or-later
"""Residuals of picture elements other than keypoints."""
