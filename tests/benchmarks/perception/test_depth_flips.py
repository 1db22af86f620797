# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth flips that were put in by hand, and a body whose arm is bent in single frames.

The figures of the faces' benchmark, on weights made by hand.

The measure of silhouettes: figures by hand, and a body drawn into a rotated region where its
projection lies.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.benchmarks.perception.depth_flips import (
    DepthFlips,
    count_flips,
    out_of_plane_deg,
)
from scope.benchmarks.perception.faces import BLINKS, closures
from scope.benchmarks.perception.outline import overlap
from scope.scope_addon.expression_names import EXPRESSIONS

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


def blinks(*starts):
    out = np.zeros((60, len(EXPRESSIONS)))
    for start in starts:
        out[start : start + 3, BLINKS] = 0.9
    return out


@pytest.mark.parametrize(
    ("found", "figures"),
    [
        ((10, 40), {"closed_found": 1.0, "closed_false": 0.0, "closed_frames": 0.0}),
        ((11, 38), {"closed_found": 1.0, "closed_false": 0.0, "closed_frames": 1.5}),
        ((10, 25), {"closed_found": 0.5, "closed_false": 0.5, "closed_frames": 0.0}),
    ],
)
def test_closures_are_matched_in_time(found, figures):
    assert closures(blinks(*found), blinks(10, 40), np.zeros(60, int)) == figures


def test_figures_of_two_rectangles() -> None:
    """The body covers 6 x 4 pixels, the mask 6 x 8, of which 2 columns lie outside the image; 12
    are common.
    """
    shape = np.ones((256, 256), np.uint8)
    mask = np.zeros((256, 256), bool)
    shape[10:16, 20:24] = 2
    mask[10:16, 22:30] = True
    shape[:, 28:] = 0
    found = overlap(shape, mask)
    assert found == pytest.approx(
        {"iou": 12 / (24 + 36 - 12), "body_outside": 0.5, "mask_outside": 1 - 12 / 36}
    )
    assert overlap(shape, np.zeros_like(mask)) is None
