# SPDX-License-Identifier: GPL-3.0-or-later
"""From tracks to body states in the camera frame, and estimates made by fitting."""
