# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the sample clip: the default body in a motion written by hand, with exact ground truth."""
