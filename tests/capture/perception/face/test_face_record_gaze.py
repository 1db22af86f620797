# SPDX-License-Identifier: GPL-3.0-or-later
"""The direction of eyes whose irises were placed on an eyeball of 12 mm, however the head is
turned.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.face_record import gaze, head_axes
from scope.solver.rotations import exp

# Metres in the head's axes: x to the person's left, y up, z out of the face.
CORNERS = {362: (0.016, 0, 0), 263: (0.046, 0, 0), 133: (-0.016, 0, 0), 33: (-0.046, 0, 0)}
R_CAMERA_FRONTAL = np.diag([1.0, -1.0, -1.0])


def landmarks(direction: np.ndarray, turn: tuple[float, float, float]) -> np.ndarray:
    points = np.zeros((478, 3))
    for number, point in CORNERS.items():
        points[number] = point
    points[10] = (0, 0.08, 0)
    points[152] = (0, -0.11, 0)
    for iris, x in ((473, 0.031), (468, -0.031)):
        points[iris] = np.array([x, 0, 0]) + 0.012 * direction
    return 2000 * points @ (R_CAMERA_FRONTAL @ exp(np.array(turn))).T + [400, 300, 0]


@pytest.mark.parametrize("turn", [(0, 0, 0), (0, 0.6, 0), (0.3, -0.4, 0.5)])
@pytest.mark.parametrize(
    "direction", [(0, 0, 1), (0.4, 0, 0.92), (0.3, 0.2, 0.93), (-0.2, -0.3, 0.93)]
)
def test_the_gaze_is_where_the_irises_were_turned(direction, turn):
    direction = np.array(direction) / np.linalg.norm(direction)
    points = landmarks(direction, turn)
    np.testing.assert_allclose(
        head_axes(points), R_CAMERA_FRONTAL @ exp(np.array(turn, float)), atol=1e-9
    )
    np.testing.assert_allclose(gaze(points), [direction, direction], atol=0.01)
