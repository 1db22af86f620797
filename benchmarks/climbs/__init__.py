# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendered people who climb onto boxes: what `--uneven-ground` is for."""
