# SPDX-License-Identifier: GPL-3.0-or-later
"""From observations to tracks: tracking, association over time, and repair of the networks'
mistakes.
"""
