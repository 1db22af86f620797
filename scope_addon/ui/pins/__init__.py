# SPDX-License-Identifier: GPL-3.0-or-later
"""Correcting a captured motion: pins, feet that stand, exchanged sides."""
