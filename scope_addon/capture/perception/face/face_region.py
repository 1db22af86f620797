# SPDX-License-Identifier: GPL-3.0-or-later
"""Regions of the image for the face network: from the body's head keypoints, and from the face's own landmarks.

In every region the forehead points up. The box of the landmarks fills two thirds of a region.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..landmark_network import KEYPOINT_NAMES
from ..region import Region, box_along

HEAD = tuple(range(KEYPOINT_NAMES.index("mouth_right") + 1))  # keypoints of the body: nose, eyes, ears, mouth
_EYES = [KEYPOINT_NAMES.index(f"{side}_eye") for side in ("left", "right")]
_EARS = [KEYPOINT_NAMES.index(f"{side}_ear") for side in ("left", "right")]
_MOUTH = [KEYPOINT_NAMES.index(f"mouth_{side}") for side in ("left", "right")]
# Distances on an adult's face: each gives a scale, the largest of which is the least foreshortened.
_EYES_M, _EYES_TO_MOUTH_M, _EARS_M = 0.063, 0.068, 0.150
FACE_M = 0.185  # longer side of the box of the landmarks, which reaches from the hairline to the chin
_MIDDLE = 0.3  # of the face, from the eyes towards the mouth, in their distance
_SCALE = 1.5  # side of a region in longer sides of the box
_OUTER_EYES = (33, 263)  # landmarks: the outer corners of the right and the left eye


def pixels_per_metre(keypoints_px: NDArray[np.float64]) -> float:
    """Estimate the image scale at the head from the body's keypoints (33, 2)."""
    eyes, mouth = keypoints_px[_EYES], keypoints_px[_MOUTH].mean(axis=0)
    return max(
        float(np.linalg.norm(eyes[0] - eyes[1])) / _EYES_M,
        float(np.linalg.norm(mouth - eyes.mean(axis=0))) / _EYES_TO_MOUTH_M,
        float(np.linalg.norm(keypoints_px[_EARS[0]] - keypoints_px[_EARS[1]])) / _EARS_M,
    )


def region_from_body(keypoints_px: NDArray[np.float64]) -> Region:
    """Predict the region of the face from the body's keypoints (33, 2), in pixels.

    Up is from the mouth to the eyes, and across the line of the eyes, each as far as it is not foreshortened.
    """
    eyes, mouth = keypoints_px[_EYES], keypoints_px[_MOUTH].mean(axis=0)
    middle = eyes.mean(axis=0)
    dx, dy = eyes[0] - eyes[1]  # from the right eye to the left one, to the right in an image of a front view
    up = (middle - mouth) + np.array([dy, -dx])
    center = middle + _MIDDLE * (mouth - middle)
    side = _SCALE * FACE_M * pixels_per_metre(keypoints_px)
    return Region((float(center[0]), float(center[1])), side, math.atan2(float(up[0]), -float(up[1])))


def facing(world_landmarks: NDArray[np.float64]) -> float:
    """Return the cosine of the angle between where the body's head looks and the direction to the camera.

    It looks along (left ear − right ear) × (eyes − mouth): -1 is the back of a head, 1 a face from the front.

    Where the body's network exchanges left and right, a face from the front counts as the back of a head.

    :param world_landmarks: (33, 3) of the body, metres, camera axes; all 0 where depth is unknown, for which this is 1.
    """
    across = world_landmarks[_EARS[0]] - world_landmarks[_EARS[1]]
    up = world_landmarks[_EYES].mean(axis=0) - world_landmarks[_MOUTH].mean(axis=0)
    ahead = np.cross(across, up)
    length = float(np.linalg.norm(ahead))
    return -float(ahead[2]) / length if length > 0 else 1.0


def region_from_landmarks(landmarks_px: NDArray[np.float64]) -> Region:
    """Calculate the region for the next frame from this one's landmarks (478, 2): their box along the line of the eyes.

    :param landmarks_px: pixels.
    """
    dx, dy = landmarks_px[_OUTER_EYES[1]] - landmarks_px[_OUTER_EYES[0]]
    rotation = math.atan2(float(dy), float(dx))
    (x, y), sides = box_along(landmarks_px, rotation)
    return Region((float(x), float(y)), _SCALE * float(sides.max()), rotation)
