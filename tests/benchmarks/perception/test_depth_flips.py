# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth flips that were put in by hand, and a body whose arm is bent in single frames."""

from __future__ import annotations

import numpy as np
import pytest
from scope.benchmarks.perception.depth_flips import (
    DepthFlips,
    count_flips,
    out_of_plane_deg,
)

RATE = 10.0


def counted(captured, true, rows=None):
    """The counts of one bone's angles."""
    captured, true = (np.array(deg, float)[:, None] for deg in (captured, true))
    return count_flips(
        captured, true, np.arange(len(true)) if rows is None else np.array(rows), RATE
    )


def test_the_angle_is_to_the_plane_across_the_line_of_sight():
    towards = np.array([0.6, 0.0, 0.8])  # the middle of the bone is in this direction, 5 m away
    across = np.array([0.8, 0.0, -0.6])
    for degrees in (-70.0, -15.0, 0.0, 40.0):
        half = 0.1 * (np.cos(np.radians(degrees)) * across + np.sin(np.radians(degrees)) * towards)
        assert out_of_plane_deg(5 * towards - half, 5 * towards + half) == pytest.approx(degrees)


def test_a_flip_counts_as_brief_if_it_begins_and_ends_within_the_clip():
    assert counted([30, -30, -30, 30], [30, 30, 30, 30]) == DepthFlips(1, 2, 4, 0, 0)
    # when did it begin?
    assert counted([-30, -30, 30, 30], [30, 30, 30, 30]) == DepthFlips(0, 2, 4, 0, 0)
    assert counted([30, 30, -30, -30], [30, 30, 30, 30]) == DepthFlips(0, 2, 4, 0, 0)
    assert counted([-30, 30, -30, 30, -30], [30] * 5) == DepthFlips(1, 3, 5, 0, 0)


def test_a_bone_crosses_the_image_plane_by_its_true_angles():
    assert counted([20, 20, 20, -20], [20, 0, -20, -20]) == DepthFlips(1, 1, 3, 1, 1)
    assert counted([20, -20, 20], [20, 10, 20]) == DepthFlips(0, 0, 2, 0, 0)
