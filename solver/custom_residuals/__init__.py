# SPDX-License-Identifier: GPL-3.0-or-later
"""Residuals that other packages register: compiled kernels, or Python functions with finite
differences.
"""
