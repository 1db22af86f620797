# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the default body's face with known expressions, views and identities, to measure and to
calibrate on.
"""
