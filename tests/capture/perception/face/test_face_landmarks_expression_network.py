# SPDX-License-Identifier: GPL-3.0-or-later
"""The expression network on a real face: which side is which, and that one eye can be closed
alone.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.face_landmarks import EXPRESSION_POINTS, ExpressionNetwork
from scope.solver.names import EXPRESSIONS

# Upper lid, lower lid and corners of the person's left and right eye, in the mesh of 478 points.
LIDS = {
    "Left": ((398, 384, 385, 386, 387, 388, 466), (382, 381, 380, 374, 373, 390, 249)),
    "Right": ((173, 157, 158, 159, 160, 161, 246), (155, 154, 153, 145, 144, 163, 7)),
}


@pytest.fixture(scope="module")
def weights_of():
    network = ExpressionNetwork()
    return lambda landmarks: network.estimate(landmarks[list(EXPRESSION_POINTS), :2])


@pytest.mark.parametrize("side", ["Left", "Right"])
def test_closing_one_eye_is_a_blink_of_that_eye(face, weights_of, side):
    _, estimate = face
    closed = estimate.landmarks.copy()
    upper, lower = LIDS[side]
    closed[list(upper)] = closed[list(lower)]
    before = weights_of(estimate.landmarks)
    after = weights_of(closed)
    rise = {eye: (after - before)[EXPRESSIONS.index(f"eyeBlink{eye}")] for eye in LIDS}
    other = "Left" if side == "Right" else "Right"
    assert rise[side] > 0.2
    assert rise[side] > 2 * rise[other]


def test_the_expression_does_not_depend_on_position_and_size(face, weights_of):
    _, estimate = face
    moved = 3.0 * estimate.landmarks + [500.0, 70.0, 0.0]
    np.testing.assert_allclose(weights_of(moved), weights_of(estimate.landmarks), atol=1e-3)
