# SPDX-License-Identifier: GPL-3.0-or-later
"""Observations to tracks: association of people over time, and repair of what the networks get wrong."""
