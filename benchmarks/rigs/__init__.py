# SPDX-License-Identifier: GPL-3.0-or-later
"""Small rigs with the names and rest poses of common tools, and how well a motion fits them."""
