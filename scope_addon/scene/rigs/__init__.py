# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions on the user's own rigs."""
