# SPDX-License-Identifier: GPL-3.0-or-later
"""The axis conventions of Blender's cameras and of glTF; see ``kinematics/axes.py`` for the others.

| frame    | right-handed axes                             | used by                |
|----------|-----------------------------------------------|------------------------|
| gltf     | y up, model faces +z                          | .glb, .bvh             |
| blendcam | Blender camera: x right, y up, looks along −z | Blender camera objects |
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kinematics.axes import R_WORLD_MODEL

# OpenCV camera axes in those of a Blender camera (which looks along its −z with y up).
R_CAMERA_BLENDCAM = np.diag([1.0, -1.0, -1.0])
# glTF and SMPL agree (y up, facing +z); Blender's exporters turn z up into y up with the inverse of
# R_WORLD_MODEL.
R_GLTF_WORLD = R_WORLD_MODEL.T.copy()


def blender_camera_matrix(world_from_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert the pose of an OpenCV camera to that of a Blender camera object with the same view.

    ``world_from_blendcam = world_from_camera · diag(R_camera_blendcam, 1)``.

    :param world_from_camera: (..., 4, 4) OpenCV camera to world.
    :return: (..., 4, 4) Blender camera to world.
    """
    camera_from_blendcam = np.eye(4)
    camera_from_blendcam[:3, :3] = R_CAMERA_BLENDCAM
    return np.asarray(world_from_camera) @ camera_from_blendcam


def camera_pose(world_from_blendcam: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert the pose of a Blender camera object to that of the OpenCV camera with the same view.

    :param world_from_blendcam: (..., 4, 4) Blender camera to world.
    :return: (..., 4, 4) OpenCV camera to world.
    """
    # Half a turn about x is its own inverse.
    return blender_camera_matrix(world_from_blendcam)


def blender_brown_distortion(dist: NDArray[np.float64]) -> tuple[float, float, float, float, float]:
    """Convert OpenCV's (k1, k2, p1, p2, k3) to the coefficients k1, k2, k3, p1, p2 of Blender's
    Brown model.

    Both add a tangential term to (x, y)(1 + k1 r² + k2 r⁴ + k3 r⁶), in units of the focal length:

        OpenCV, y down:    (2 p1 xy + p2 (r² + 2x²),  p1 (r² + 2y²) + 2 p2 xy)
        Blender, y up:     (p1 (r² + 2x²) + 2 p2 xy,  p2 (r² + 2y²) + 2 p1 xy)

    Therefore p1 and p2 are swapped, and the one that belongs to y changes its sign.
    Source: OpenCV's camera calibration, libmv's ApplyBrownDistortionModel.

    :param dist: (5,) of the footage's camera.
    """
    k1, k2, p1, p2, k3 = (float(c) for c in dist)
    return k1, k2, k3, p2, -p1
