# SPDX-License-Identifier: GPL-3.0-or-later
"""The direction of each eye from the position of its iris between the corners of the eye.

The head's frame: x to the person's left, y up, z out of the face.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_FOREHEAD, _CHIN = 10, 152  # landmarks
# Inner corner, outer corner and iris of the left and of the right eye.
_EYES = ((362, 263, 473), (133, 33, 468))
_RADIUS = 0.4  # of the eyeball, 12 mm, over the distance of the eye's corners, 30 mm
_LARGEST_SINE = 0.9


def head_axes(landmarks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Calculate R_camera_head (3, 3), up to the camera's perspective, from landmarks (478, 3) in pixels."""
    left = landmarks[_EYES[0][1]] - landmarks[_EYES[1][1]]
    up = landmarks[_FOREHEAD] - landmarks[_CHIN]
    x = left / np.linalg.norm(left)
    z = np.cross(x, up)
    z /= np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z], axis=1)


def gaze(landmarks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimate the unit directions (2, 3) in which the left and the right eye look, in the head's frame.

    With the iris at offset (u, v) from the middle of the eye's corners, along the head's x and y axes, and the
    eyeball's radius r: sin(azimuth) = u / r, sin(elevation) = v / r.

    :param landmarks: (478, 3) pixels, and depth in pixels.
    """
    R_camera_head = head_axes(landmarks)
    out = np.empty((2, 3))
    for direction, (inner, outer, iris) in zip(out, _EYES, strict=True):
        corners = landmarks[[inner, outer]]
        radius = _RADIUS * float(np.linalg.norm(corners[0] - corners[1]))
        offset = (landmarks[iris] - corners.mean(axis=0)) @ R_camera_head[:, :2] / max(radius, 1e-9)
        direction[:2] = np.clip(offset, -_LARGEST_SINE, _LARGEST_SINE)
        direction[2] = np.sqrt(max(1.0 - float(direction[:2] @ direction[:2]), 0.05))
        direction /= np.linalg.norm(direction)
    return out
