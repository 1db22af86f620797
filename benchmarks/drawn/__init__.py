# SPDX-License-Identifier: GPL-3.0-or-later
"""Cheap clips with exact truth: walkers in textured rooms and streets, drawn in seconds a clip, for
cameras that travel and for several cameras.
"""
