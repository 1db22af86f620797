# SPDX-License-Identifier: GPL-3.0-or-later
"""A body that was placed at a wrong distance is moved to where its feet are on the known floor.

Depth corrected by the floor, on motions with known ground truth.
"""

import numpy as np
import pytest
from scope.benchmarks.ablation import ROWS, replaced
from scope.scope_addon.capture.world import stance
from scope.scope_addon.capture.world.stance import stance_on_ground
from scope.scope_addon.kinematics import standing
from scope.scope_addon.kinematics.axes import world_from_level_camera

from ...kinematics.posed_people import stepping_person
from .placed_people import TRUTH, UP, stands_at


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


CAMERA = np.zeros(3)


@pytest.fixture(scope="module")
def step():
    return stepping_person()


def test_a_wrong_depth_is_corrected_by_the_floor(step):
    _, omega, root, place, T_world_camera, times = step
    unit = root / np.linalg.norm(root, axis=1, keepdims=True)
    wrong = 0.15 * np.sin(2 * np.pi * 0.4 * times)
    seen = place(omega, root + wrong[:, None] * unit)[2]
    contact = standing.resting_probability(seen, T_world_camera[2, :3], times, CAMERA)
    away = stance.correct_depth(root + wrong[:, None] * unit, seen, contact, T_world_camera, times)
    assert np.abs(away + wrong).mean() < 0.25 * np.abs(wrong).mean()
    left = np.diff(wrong + away)[:28]  # while both feet stand
    assert np.abs(left).max() < 0.1 * np.abs(np.diff(wrong)).max()  # and what is left hardly slides


def test_a_right_depth_is_not_changed(step):
    _, omega, root, place, T_world_camera, times = step
    soles = place(omega, root)[2]
    contact = standing.resting_probability(soles, T_world_camera[2, :3], times, CAMERA)
    assert np.abs(stance.correct_depth(root, soles, contact, T_world_camera, times)).max() < 0.05


def test_feet_above_the_floor_do_not_move_the_body_on_uneven_ground(step):
    _, omega, root, place, T_world_camera, times = step
    raised = root + 0.1 * T_world_camera[2, :3]
    soles = place(omega, raised)[2]
    contact = standing.resting_probability(soles, T_world_camera[2, :3], times, CAMERA)
    given = (raised, soles, contact, T_world_camera, times)
    assert np.abs(stance.correct_depth(*given)).max() > 0.15
    np.testing.assert_allclose(stance.correct_depth(*given, one_floor=False), 0.0, atol=0.05)


def test_the_depth_system_is_solved_as_a_dense_one():
    rng = np.random.default_rng(0)
    off = rng.normal(size=30)
    diagonal = 3 + np.abs(np.r_[off, 0]) + np.abs(np.r_[0, off])
    right = rng.normal(size=31)
    dense = np.diag(diagonal) + np.diag(off, 1) + np.diag(off, -1)
    assert np.allclose(
        stance._solve_tridiagonal(diagonal, off, right), np.linalg.solve(dense, right)
    )
