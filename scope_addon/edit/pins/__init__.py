# SPDX-License-Identifier: GPL-3.0-or-later
"""Corrections of single frames: pins, feet that stand, exchanged sides."""
