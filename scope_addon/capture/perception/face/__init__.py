# SPDX-License-Identifier: GPL-3.0-or-later
"""The face: its region in the image, its landmarks, and the expression and gaze that these show."""
