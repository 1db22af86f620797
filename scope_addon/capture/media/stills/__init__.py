# SPDX-License-Identifier: GPL-3.0-or-later
"""Single pictures: their formats, their metadata, and how they become upright 8-bit RGB."""
