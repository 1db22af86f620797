# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders the sample clip: our own body in a motion written by hand, with the exact truth beside it."""
