# SPDX-License-Identifier: GPL-3.0-or-later
"""Intrinsics that a data set does not state, from joints in the camera and their pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def intrinsics_of_projection(
    joints: NDArray[np.float64], pixels: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return K (3, 3) that minimizes Σ (f_x x + c_x z − u z)² + Σ (f_y y + c_y z − v z)², without
    distortion.

    :param joints: (..., 3) in the camera, metres; those behind it are not used.
    :param pixels: (..., 2), u and v.
    :return: None where too few joints are in front of the camera, or the result is no camera.
    """
    points = joints.reshape(-1, 3)
    uv = pixels.reshape(-1, 2)
    ahead = points[:, 2] > 0
    points = points[ahead]
    uv = uv[ahead]
    if len(points) < 4:
        return None
    K = np.eye(3)
    for axis in range(2):
        A = points[:, [axis, 2]]
        (K[axis, axis], K[axis, 2]), *_ = np.linalg.lstsq(A, uv[:, axis] * points[:, 2], rcond=None)
    return K if K[0, 0] > 0 and K[1, 1] > 0 else None
