# SPDX-License-Identifier: GPL-3.0-or-later
"""Where to look for a hand: from the body's arm, from a palm that was detected, from the hand's own keypoints.

All regions have the fingers pointing up, seen from the wrist. A hand with stretched fingers fills half of a region.
"""

from __future__ import annotations

import math

import numpy as np

from .landmark_network import KEYPOINT_NAMES
from .region import Region

SIDES = ("left", "right")
HAND_LENGTH_M = 0.18  # wrist to the tip of the middle finger
_ARM = np.array(
    [[KEYPOINT_NAMES.index(f"{side}_{name}") for name in ("elbow", "wrist", "index", "pinky")] for side in SIDES]
)
WRISTS = _ARM[:, 1]
_STATURE = [
    [KEYPOINT_NAMES.index(f"{side}_{name}") for name in ("shoulder", "hip", "knee", "ankle")] for side in SIDES
]
_STATURE_M = 1.35  # shoulder to ankle along the bones
_MIDDLE = 0.45  # of the hand's length: how far beyond the wrist its middle lies
_BODY_SCALE = 1.5  # sides of the region per hand length: the body tells roughly where the hand is
_PALM_SCALE, _PALM_SHIFT = 2.6, 0.5  # MediaPipe's: side over the palm's box, and how far towards the fingers, in boxes
_TRACK_SCALE, _TRACK_SHIFT = 2.0, 0.1  # the same over the box of the keypoints below
_STEADY = np.array([0, 1, 2, 3, 5, 6, 9, 10, 13, 14, 17, 18])  # keypoints of palm and finger bases


def pixels_per_metre(keypoints_px: np.ndarray, world_landmarks: np.ndarray) -> float:
    """How large a metre at the person's distance is in the image.

    s = ‖p − mean p‖ / ‖w_xy − mean w_xy‖ of all 33 keypoints p and world landmarks w: a scaled orthographic view. Where
    the world landmarks are not known (all 0), the length of trunk and longer leg in the image over an adult's.
    """
    if not world_landmarks.any():
        trunk_and_legs = [np.linalg.norm(np.diff(keypoints_px[chain], axis=0), axis=1).sum() for chain in _STATURE]
        return float(max(trunk_and_legs)) / _STATURE_M
    image = keypoints_px - keypoints_px.mean(axis=0)
    space = world_landmarks[:, :2] - world_landmarks[:, :2].mean(axis=0)
    return float(np.linalg.norm(image) / np.maximum(np.linalg.norm(space), 1e-9))


def region_from_body(keypoints_px: np.ndarray, scale: float, side: int) -> Region:
    """The region in which the hand of a body should be.

    Its middle lies beyond the wrist, in the direction in which the body's finger keypoints m = (index + pinky) / 2 lie,
    as far as they are foreshortened; where they coincide with the wrist, along the forearm. m lies half-way down the
    hand, so the middle is wrist + (m − wrist) · 0.45 / 0.5.

    :param keypoints_px: (33, 2) of the body;  scale: `pixels_per_metre`;  side: 0 left, 1 right.
    """
    elbow, wrist, index, pinky = keypoints_px[_ARM[side]]
    length = HAND_LENGTH_M * scale
    reach = (index + pinky) / 2 - wrist
    most = 0.6 * length
    reach *= min(1.0, most / max(float(np.linalg.norm(reach)), 1e-9))
    forearm = wrist - elbow
    up = reach / max(0.5 * length, 1e-9) + 0.5 * forearm / max(float(np.linalg.norm(forearm)), 1e-9)
    center = wrist + reach * (_MIDDLE / 0.5)
    return Region((float(center[0]), float(center[1])), _BODY_SCALE * length, _rotation(up))


def region_from_palm(box_px: np.ndarray, points_px: np.ndarray) -> Region:
    """The region of a hand from its palm: a square box and 7 points, 0 the wrist, 2 the base of the middle finger.

    :param box_px: (4,) left, top, right, bottom in axes in which the palm was detected;  points_px: (7, 2).
    """
    size = float(max(box_px[2] - box_px[0], box_px[3] - box_px[1]))
    up = points_px[2] - points_px[0]
    return _moved((box_px[:2] + box_px[2:]) / 2, size, _rotation(up), _PALM_SCALE, _PALM_SHIFT)


def region_from_landmarks(keypoints_px: np.ndarray) -> Region:
    """The region for the next frame from this one's keypoints (21, 2).

    Up is from the wrist to the middle of the index's, middle's and ring's first joints (weights ¼, ½, ¼); the box is
    that of the palm and the fingers' bases in these axes, so that fingers that move do not move the region.
    """
    up = 0.25 * (keypoints_px[5] + keypoints_px[13]) + 0.5 * keypoints_px[9] - keypoints_px[0]
    rotation = _rotation(up)
    R_image_crop = Region((0.0, 0.0), 1.0, rotation).R_image_crop
    turned = keypoints_px[_STEADY] @ R_image_crop
    low, high = turned.min(axis=0), turned.max(axis=0)
    return _moved(R_image_crop @ ((low + high) / 2), float((high - low).max()), rotation, _TRACK_SCALE, _TRACK_SHIFT)


def _moved(center: np.ndarray, size: float, rotation: float, scale: float, shift: float) -> Region:
    """A region ``scale`` times ``size``, moved up (in its own axes) by ``shift`` sizes."""
    up = np.array([math.sin(rotation), -math.cos(rotation)])
    x, y = center + shift * size * up
    return Region((float(x), float(y)), scale * size, rotation)


def _rotation(up: np.ndarray) -> float:
    """The rotation of a region in which the image direction ``up`` points up."""
    return math.atan2(float(up[0]), -float(up[1]))
