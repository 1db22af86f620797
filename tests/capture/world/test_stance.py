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


@pytest.mark.parametrize("error_m", [-0.25, 0.25])
def test_a_wrong_distance_is_corrected_along_the_line_of_sight(error_m: float) -> None:
    truth = stands_at(TRUTH)
    height = float((truth.contact_points[0, :4] @ -UP).mean())  # of the camera above the soles
    away = truth.root[0] / np.linalg.norm(truth.root[0])
    placed = stands_at(TRUTH + error_m * away)
    with replaced(ROWS["without balance in it"]["replacements"]):
        stance = stance_on_ground(placed, world_from_level_camera(UP, height))
    left = stance.root_cam - truth.root
    np.testing.assert_allclose(np.cross(left, away), 0.0, atol=1e-6)
    assert np.linalg.norm(left, axis=1).max() <= 0.3 * abs(error_m)
    np.testing.assert_array_equal(stance.turn, np.broadcast_to(np.eye(3), (len(left), 3, 3)))


CAMERA = np.zeros(3)


@pytest.fixture(scope="module")
def step():
    return stepping_person()


def correction(step, shift, one_floor=True):
    """The correction (T,) of the depths of somebody who is shifted (T, 3) from where they are."""
    _, omega, root, place, T_world_camera, times = step
    points = place(omega, root + shift)[2]
    contact = standing.resting_probability(points, T_world_camera[2, :3], times, CAMERA)
    return stance.correct_depth(root + shift, points, contact, T_world_camera, times, one_floor)


def test_a_wrong_depth_is_corrected_by_the_floor(step):
    root = step[2]
    unit = root / np.linalg.norm(root, axis=1, keepdims=True)
    wrong = 0.15 * np.sin(2 * np.pi * 0.4 * step[5])
    away = correction(step, wrong[:, None] * unit)
    assert np.abs(away + wrong).mean() < 0.25 * np.abs(wrong).mean()
    left = np.diff(wrong + away)[:28]  # while both feet stand
    assert np.abs(left).max() < 0.1 * np.abs(np.diff(wrong)).max()  # and what is left hardly slides


def test_a_right_depth_is_not_changed(step):
    assert np.abs(correction(step, 0.0)).max() < 0.05


def test_feet_above_the_floor_do_not_move_the_body_on_uneven_ground(step):
    higher = 0.1 * step[4][2, :3]
    assert np.abs(correction(step, higher)).max() > 0.15
    np.testing.assert_allclose(correction(step, higher, one_floor=False), 0.0, atol=0.05)
