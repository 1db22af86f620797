# SPDX-License-Identifier: GPL-3.0-or-later
"""Axis conventions, contact, smoothing and optimal paths: what capture, editing and retargeting
share.
"""
