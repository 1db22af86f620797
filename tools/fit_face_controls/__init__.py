# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting the built-in expression maps of faces that bones move to the shapes of the default body's
expressions.
"""
