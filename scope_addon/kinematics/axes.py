# SPDX-License-Identifier: GPL-3.0-or-later
"""The axis conventions of SMPL, glTF, OpenCV, OpenSim and the world, in one place; those of
Blender's cameras are in ``scene/camera.py``.

| frame  | right-handed axes                                   | used by                         |
|--------|-----------------------------------------------------|---------------------------------|
| camera | OpenCV: x right, y down, z forward                  | solver, joints_cam, intrinsics  |
| world  | x right, z up, floor at z = 0                       | motion file, Blender scenes     |
| model  | SMPL: y up, x to the person's left, person faces +z | rest pose of a body, .glb, .bvh |
| opensim| x forward, y up, z to the right                      | .trc and .mot files             |

``R_a_b`` takes coordinates in frame b to coordinates in frame a: ``p_a = R_a_b @ p_b``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Float64Array, FloatArray

UP = np.array([0.0, 0.0, 1.0])  # The world's up direction.
# Model y up becomes world z up, (x, y, z) -> (x, -z, y): the person faces world −y, into Blender's
# front view.
R_WORLD_MODEL = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
# A level OpenCV camera in the world: x right stays, y down is −z, z forward is +y.
R_WORLD_LEVELCAMERA = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
# OpenSim's y points up: (x, y, z) -> (y, z, x), as Pose2Sim converts a world with z up.
R_OPENSIM_WORLD = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])

# In the rest pose, OpenSim's x points forward, y up, and z to the person's right.
R_OPENSIM_MODEL = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


def world_from_level_camera(up_camera: ArrayLike, height: float = 0.0) -> Float64Array:
    """Return the camera pose in a world whose z axis is the given up direction and whose +y the
    camera faces.

    The heading keeps the optical axis in the world's y-z plane, so a level camera gives
    ``R_WORLD_LEVELCAMERA``. The camera is at (0, 0, height).

    :param up_camera: (3,) up direction in the camera frame, any length.
    :param height: metres of the camera above the floor.
    :return: (4, 4) world_from_camera.
    """
    up = np.asarray(up_camera, float) / np.linalg.norm(up_camera)
    forward = np.array([0.0, 0.0, 1.0])
    forward = forward - up * (forward @ up)
    # A camera that looks straight up or down has no heading: use the image's vertical instead.
    if np.linalg.norm(forward) < 1e-6:
        forward = np.array([0.0, 1.0, 0.0]) - up * up[1]
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = np.stack([right, forward, up])
    T_world_camera[2, 3] = height
    return T_world_camera


def transform_points(T_a_b: FloatArray, points_b: FloatArray) -> FloatArray:
    """Return ``p_a = R p_b + t`` for (..., 4, 4) transforms and (..., N, 3) points."""
    return points_b @ np.swapaxes(T_a_b[..., :3, :3], -1, -2) + T_a_b[..., None, :3, 3]


def rotated(rotations: FloatArray, vectors: FloatArray) -> Float64Array:
    """Return the vectors (..., 3) rotated by (..., 3, 3)."""
    return (rotations @ vectors[..., None])[..., 0]


def transposed(rotations: FloatArray) -> Float64Array:
    """Return the inverse rotations (..., 3, 3)."""
    return np.swapaxes(rotations, -1, -2)


def unscaled(matrices: FloatArray) -> Float64Array:
    """Return the orthogonal matrices (..., 3, 3) nearest to those that scale or shear, which may
    mirror.
    """
    U, _, Vt = np.linalg.svd(matrices)
    return U @ Vt
