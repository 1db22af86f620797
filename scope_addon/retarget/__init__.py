# SPDX-License-Identifier: GPL-3.0-or-later
"""A body's motion on another skeleton, in numpy: which bone is which body part, and how their rotations follow."""
