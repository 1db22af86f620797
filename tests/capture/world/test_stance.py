# SPDX-License-Identifier: GPL-3.0-or-later
"""A body that was placed at a wrong distance is moved to where its feet are on the known floor."""

import numpy as np
import pytest
from scope.benchmarks.ablation import ROWS, replaced
from scope.scope_addon.capture.world.placement import PlacedTrack
from scope.scope_addon.capture.world.stance import stance_on_ground
from scope.scope_addon.kinematics.axes import world_from_level_camera
from scope.scope_addon.kinematics.contact_points import contact_point_positions, with_contact_points
from scope.solver.body_file import load_body
from scope.solver.rotations import exp

UP = np.array([0.0, -1.0, 0.0])  # OpenCV's axes, a level camera
TRUTH = np.array([0.3, 1.2, 4.0])  # the pelvis, seen from above


def stands_at(root: np.ndarray, T: int = 30) -> PlacedTrack:
    """The body in rest pose at (3,), in front of a static camera."""
    body = load_body("scope")
    supported = with_contact_points(body, np.zeros(body.P))
    rotations = np.tile(np.eye(3), (T, body.K + 1, 1, 1))
    rotations[:, 0] = exp([np.pi, 0.0, 0.0])
    R, joints = supported.forward_kinematics(rotations, np.tile(root, (T, 1)))
    contact_points = contact_point_positions(supported, R, joints)
    every = np.ones(T, bool)
    return PlacedTrack(
        supported,
        np.zeros(body.P),
        np.arange(T) / 30,
        every,
        rotations,
        joints[:, 0],
        joints,
        contact_points,
        np.ones((T, 6)),
        np.zeros((T, 3)),
    )


@pytest.mark.parametrize("error_m", [-0.25, 0.0, 0.25])
def test_a_wrong_distance_is_corrected_along_the_line_of_sight(error_m: float) -> None:
    truth = stands_at(TRUTH)
    height = float((truth.contact_points[0, :4] @ -UP).mean())  # of the camera above the soles
    away = truth.root[0] / np.linalg.norm(truth.root[0])
    placed = stands_at(TRUTH + error_m * away)
    with replaced(ROWS["without balance in it"]["replacements"]):
        stance = stance_on_ground(placed, world_from_level_camera(UP, height))
    left = stance.root_cam - truth.root
    np.testing.assert_allclose(np.cross(left, away), 0.0, atol=1e-6)
    assert np.linalg.norm(left, axis=1).max() <= 0.3 * abs(error_m) + 1e-3
    np.testing.assert_array_equal(stance.turn, np.broadcast_to(np.eye(3), (len(left), 3, 3)))
