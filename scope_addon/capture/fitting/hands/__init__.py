# SPDX-License-Identifier: GPL-3.0-or-later
"""Hands: from landmarks to measurements, and bodies whose fingers are not fitted."""
