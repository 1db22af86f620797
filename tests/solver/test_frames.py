# SPDX-License-Identifier: GPL-3.0-or-later
"""Axis conventions against facts that can be said in words."""

import numpy as np
import pytest
from scope.solver import frames


@pytest.mark.parametrize(
    "R", [frames.R_WORLD_MODEL, frames.R_WORLD_LEVELCAMERA, frames.R_CAMERA_BLENDCAM, frames.R_GLTF_WORLD]
)
def test_every_convention_is_a_rotation(R):
    assert np.allclose(R @ R.T, np.eye(3))
    assert np.isclose(np.linalg.det(R), 1)


def test_model_up_is_world_up_and_model_front_faces_blenders_front_view():
    assert np.allclose(frames.R_WORLD_MODEL @ [0, 1, 0], [0, 0, 1])
    assert np.allclose(frames.R_WORLD_MODEL @ [0, 0, 1], [0, -1, 0])


def test_level_camera_sees_the_sky_at_negative_y_and_looks_along_world_y():
    T = frames.world_from_level_camera(np.array([0, -2.0, 0]), height=1.5)
    assert np.allclose(T[:3, :3], frames.R_WORLD_LEVELCAMERA)
    assert np.allclose(frames.transform_points(T, np.array([[0, 0, 4.0], [1, 1.5, 4.0]])), [[0, 4, 1.5], [1, 4, 0]])


@pytest.mark.parametrize("up", [[0, -1, 0.3], [0.2, -1, -0.4], [0, 0, 1.0], [0, 0, -1.0], [1, 0, 0]])
def test_the_given_up_becomes_world_z(up):
    T = frames.world_from_level_camera(np.array(up, float))
    assert np.allclose(T[:3, :3] @ (np.array(up) / np.linalg.norm(up)), [0, 0, 1])
    assert np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3))
    assert np.isclose(np.linalg.det(T[:3, :3]), 1)


def test_blender_camera_looks_along_its_minus_z_where_opencv_looks_along_plus_z():
    T = np.eye(4)
    T[:3, 3] = [1, 2, 3]
    B = frames.blender_camera_matrix(T)
    assert np.allclose(B @ [0, 0, -1, 1], [1, 2, 4, 1])  # forward
    assert np.allclose(B @ [0, 1, 0, 1], [1, 1, 3, 1])  # the image's up is OpenCV's −y
