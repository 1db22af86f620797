# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how the face networks answer to the expressions of rendered faces: what the fit of
expressions goes by.
"""
