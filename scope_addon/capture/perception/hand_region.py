# SPDX-License-Identifier: GPL-3.0-or-later
"""Regions of the image for the hand network: from the body's arm, from a detected palm, from the hand's keypoints.

In every region the fingers point up from the wrist. A hand with straight fingers fills half of a region.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .landmark_network import KEYPOINT_NAMES
from .region import Region, box_along

SIDES = ("left", "right")
HAND_LENGTH_M = 0.18  # wrist to the tip of the middle finger
_ARM = np.array(
    [[KEYPOINT_NAMES.index(f"{side}_{name}") for name in ("elbow", "wrist", "index", "pinky")] for side in SIDES]
)
ELBOWS, WRISTS = _ARM[:, 0], _ARM[:, 1]
_STATURE = [[KEYPOINT_NAMES.index(f"{side}_{name}") for name in ("shoulder", "hip", "knee", "ankle")] for side in SIDES]
_STATURE_M = 1.35  # shoulder to ankle along the bones
_MIDDLE = 0.45  # distance from the wrist to the hand's centre, in hand lengths
_BODY_SCALE = 1.5  # side of the region in hand lengths; large, because the body gives only a rough position
_PALM_SCALE, _PALM_SHIFT = 2.6, 0.5  # MediaPipe's: side, and shift towards the fingers, in sides of the palm's box
_TRACK_SCALE, _TRACK_SHIFT = 2.0, 0.1  # the same in sides of the box of the keypoints below
_RIGID = np.array([0, 1, 2, 3, 5, 6, 9, 10, 13, 14, 17, 18])  # keypoints of the palm and of the finger bases


def pixels_per_metre(keypoints_px: NDArray[np.float64], world_landmarks: NDArray[np.float64]) -> float:
    """Estimate the image scale at the person's distance, in pixels per metre.

    s = ‖p − mean p‖ / ‖w_xy − mean w_xy‖ of all 33 keypoints p and world landmarks w, by scaled orthographic
    projection. Without world landmarks (all 0): the length of trunk and longer leg in the image over an adult's.

    :param keypoints_px: (33, 2) pixels.
    :param world_landmarks: (33, 3) metres in camera axes, or all 0.
    """
    if not world_landmarks.any():
        trunk_and_legs = [np.linalg.norm(np.diff(keypoints_px[chain], axis=0), axis=1).sum() for chain in _STATURE]
        return float(max(trunk_and_legs)) / _STATURE_M
    image = keypoints_px - keypoints_px.mean(axis=0)
    space = world_landmarks[:, :2] - world_landmarks[:, :2].mean(axis=0)
    return float(np.linalg.norm(image) / np.maximum(np.linalg.norm(space), 1e-9))


def region_from_body(keypoints_px: NDArray[np.float64], scale: float, side: int) -> Region:
    """Predict the region of a hand from the body's keypoints.

    The centre lies beyond the wrist in the direction of the finger keypoints' mean m = (index + pinky) / 2, with their
    foreshortening. m is half-way along the hand, so the centre is wrist + (m − wrist) · 0.45 / 0.5. The region's up
    direction follows m and the forearm.

    :param keypoints_px: (33, 2) pixels, of the body.
    :param scale: see `pixels_per_metre`.
    :param side: 0 left, 1 right.
    """
    elbow, wrist, index, pinky = keypoints_px[_ARM[side]]
    length = HAND_LENGTH_M * scale
    reach = (index + pinky) / 2 - wrist
    longest = 0.6 * length
    reach *= min(1.0, longest / max(float(np.linalg.norm(reach)), 1e-9))
    forearm = wrist - elbow
    up = reach / max(0.5 * length, 1e-9) + 0.5 * forearm / max(float(np.linalg.norm(forearm)), 1e-9)
    center = wrist + reach * (_MIDDLE / 0.5)
    return Region((float(center[0]), float(center[1])), _BODY_SCALE * length, _rotation(up))


def region_from_palm(box_px: NDArray[np.float64], points_px: NDArray[np.float64]) -> Region:
    """Calculate the region of a hand from its detected palm.

    :param box_px: (4,) left, top, right, bottom of the palm's square box, in the axes of the detector's input.
    :param points_px: (7, 2) in the same axes: 0 the wrist, 2 the base of the middle finger.
    """
    size = float(max(box_px[2] - box_px[0], box_px[3] - box_px[1]))
    up = points_px[2] - points_px[0]
    return _shifted((box_px[:2] + box_px[2:]) / 2, size, _rotation(up), _PALM_SCALE, _PALM_SHIFT)


def region_from_landmarks(keypoints_px: NDArray[np.float64]) -> Region:
    """Calculate the region for the next frame from this one's keypoints (21, 2), in pixels.

    Up is from the wrist to the weighted mean of the base joints of index, middle and ring finger (weights ¼, ½, ¼). The
    box is that of the palm and of the finger bases in these axes, so that moving fingers do not move the region.
    """
    up = 0.25 * (keypoints_px[5] + keypoints_px[13]) + 0.5 * keypoints_px[9] - keypoints_px[0]
    rotation = _rotation(up)
    center, sides = box_along(keypoints_px[_RIGID], rotation)
    return _shifted(center, float(sides.max()), rotation, _TRACK_SCALE, _TRACK_SHIFT)


def _shifted(center: NDArray[np.float64], size: float, rotation: float, scale: float, shift: float) -> Region:
    """Build a region ``scale`` times ``size``, shifted up (in its own axes) by ``shift`` sizes."""
    up = np.array([math.sin(rotation), -math.cos(rotation)])
    x, y = center + shift * size * up
    return Region((float(x), float(y)), scale * size, rotation)


def _rotation(up: NDArray[np.float64]) -> float:
    """Calculate the rotation of a region in which the image direction ``up`` (2,) points up."""
    return math.atan2(float(up[0]), -float(up[1]))
