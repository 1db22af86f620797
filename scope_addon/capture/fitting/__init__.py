# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracks to body states in the camera frame, and estimates that are made by fitting."""
