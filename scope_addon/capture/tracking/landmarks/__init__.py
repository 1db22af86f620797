# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks during tracking: which networks estimate them, when, and whether the result is
plausible.
"""
