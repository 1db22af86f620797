# SPDX-License-Identifier: GPL-3.0-or-later
"""Axis conventions against facts stated in words."""

import numpy as np
import pytest
from scope.scope_addon.kinematics import axes


def test_model_up_is_world_up_and_model_front_faces_blenders_front_view():
    assert np.allclose(axes.R_WORLD_MODEL @ [0, 1, 0], [0, 0, 1])
    assert np.allclose(axes.R_WORLD_MODEL @ [0, 0, 1], [0, -1, 0])


def test_level_camera_sees_the_sky_at_negative_y_and_looks_along_world_y():
    T = axes.world_from_level_camera(np.array([0, -2.0, 0]), height=1.5)
    assert np.allclose(T[:3, :3], axes.R_WORLD_LEVELCAMERA)
    assert np.allclose(
        axes.transform_points(T, np.array([[0, 0, 4.0], [1, 1.5, 4.0]])), [[0, 4, 1.5], [1, 4, 0]]
    )


@pytest.mark.parametrize("up", [[0, -1, 0.3], [0.7, -1, 0.6], [1, 0, 0], [0, 0, 1.0], [0, 0, -1.0]])
def test_the_given_up_becomes_world_z_and_the_camera_looks_along_world_y(up):
    R = axes.world_from_level_camera(np.array(up, float))[:3, :3]
    assert np.allclose(R @ (np.array(up) / np.linalg.norm(up)), [0, 0, 1])
    assert np.allclose(R @ R.T, np.eye(3))
    assert np.isclose(np.linalg.det(R), 1)
    forward = R @ [0, 0, 1]
    assert np.isclose(forward[0], 0)  # however the camera is rolled
    assert forward[1] > 0.5 or not any(up[:2])  # it has no heading where it looks up or down
