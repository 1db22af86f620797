# SPDX-License-Identifier: GPL-3.0-or-later
"""Causal capture of one person: each pose depends on the frames up to its own, and is given as soon
as it is known.

source  ->  newest frame  ->  track, fit, smooth, hold feet  ->  JSON lines, VMC, recording
"""
