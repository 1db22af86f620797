# SPDX-License-Identifier: GPL-3.0-or-later
"""The axis conventions of SMPL, OpenCV, Blender and glTF, in one place; nobody else converts.

| frame    | right-handed axes                                    | used by                            |
|----------|------------------------------------------------------|------------------------------------|
| camera   | OpenCV: x right, y down, z forward                   | solver, ``joints_cam``, intrinsics |
| world    | x right, z up, floor at z = 0                        | motion file, Blender scenes        |
| model    | SMPL: y up, x to the person's left, person faces +z  | rest pose of a body                |
| gltf     | y up, model faces +z                                 | .glb                               |
| blendcam | Blender camera: x right, y up, looks along −z        | Blender camera objects             |

``R_a_b`` takes coordinates in frame b to coordinates in frame a: ``p_a = R_a_b @ p_b``.
"""

from __future__ import annotations

import numpy as np

# Model y up becomes world z up, (x, y, z) -> (x, -z, y): the person faces world −y, into Blender's front view.
R_WORLD_MODEL = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
# A level OpenCV camera in the world: x right stays, y down is −z, z forward is +y.
R_WORLD_LEVELCAMERA = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
# OpenCV camera axes seen from a Blender camera (which looks along its −z with y up).
R_CAMERA_BLENDCAM = np.diag([1.0, -1.0, -1.0])
# glTF and SMPL agree (y up, facing +z); Blender's exporters turn z up into y up with the inverse of R_WORLD_MODEL.
R_GLTF_WORLD = R_WORLD_MODEL.T.copy()


def blender_camera_matrix(world_from_camera: np.ndarray) -> np.ndarray:
    """Matrix of a Blender camera object that sees what the OpenCV camera sees.

    ``world_from_blendcam = world_from_camera · diag(R_camera_blendcam, 1)``.

    :param world_from_camera: (..., 4, 4) OpenCV camera to world.
    :return: (..., 4, 4) Blender camera to world.
    """
    turn = np.eye(4)
    turn[:3, :3] = R_CAMERA_BLENDCAM
    return np.asarray(world_from_camera) @ turn


def blender_brown_distortion(dist: np.ndarray) -> tuple[float, float, float, float, float]:
    """Coefficients k1, k2, k3, p1, p2 of Blender's Brown lens that distorts as OpenCV's (k1, k2, p1, p2, k3) does.

    Both add to (x, y)(1 + k1 r² + k2 r⁴ + k3 r⁶), in units of the focal length, the tangential

        OpenCV, y down:    (2 p1 xy + p2 (r² + 2x²),  p1 (r² + 2y²) + 2 p2 xy)
        Blender, y up:     (p1 (r² + 2x²) + 2 p2 xy,  p2 (r² + 2y²) + 2 p1 xy)

    so that their names are exchanged, and the one that belongs to y changes its sign.
    Source: OpenCV's camera calibration, libmv's ApplyBrownDistortionModel.

    :param dist: (5,) of the footage's camera.
    """
    k1, k2, p1, p2, k3 = (float(c) for c in dist)
    return k1, k2, k3, p2, -p1


def world_from_level_camera(up_camera: np.ndarray, height: float = 0.0) -> np.ndarray:
    """World frame of a camera whose view of "up" is known: z along ``up``, the camera looking along +y.

    The heading is the one that keeps the optical axis in the world's y-z plane, so a level camera gives
    ``R_WORLD_LEVELCAMERA``. The camera sits at (0, 0, height).

    :param up_camera: (3,) up direction in the camera frame, any length.
    :param height: metres of the camera above the floor.
    :return: (4, 4) world_from_camera.
    """
    up = np.asarray(up_camera, float) / np.linalg.norm(up_camera)
    forward = np.array([0.0, 0.0, 1.0])
    forward = forward - up * (forward @ up)
    if np.linalg.norm(forward) < 1e-6:  # looking straight up or down: head along the image's vertical instead
        forward = np.array([0.0, 1.0, 0.0]) - up * up[1]
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = np.stack([right, forward, up])
    T_world_camera[2, 3] = height
    return T_world_camera


def transform_points(T_a_b: np.ndarray, points_b: np.ndarray) -> np.ndarray:
    """``p_a = R p_b + t`` for (..., 4, 4) transforms and (..., N, 3) points."""
    return points_b @ np.swapaxes(T_a_b[..., :3, :3], -1, -2) + T_a_b[..., None, :3, 3]
