# SPDX-License-Identifier: GPL-3.0-or-later
"""Redetection of a person who was just lost, with the image rotated: in a somersault, a fall or a handstand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...perception.adapters.keypoints.keypoint_network import KeypointNetwork
from ...perception.landmark_network import LandmarkNetwork, PoseEstimate
from ..tracked_target import TrackedTarget
from .plausibility import DISAGREEMENT_THRESHOLD, is_center_in_image, is_in_image, is_same_body, share_in_image

_ROTATIONS = tuple(k * math.pi / 6 for k in range(12))
_SCALES = (1.0, 1.35)
_MIN_PRESENCE = 0.9
_MAX_INNOVATION = 0.35
CURLED_SPREAD = 0.25
LEAVING_SHARE = 0.8  # a lost person with fewer of the keypoints in the image has left it


def redetect_rotated(
    landmarks: LandmarkNetwork | KeypointNetwork,
    image_rgb: NDArray[np.uint8],
    lost: TrackedTarget,
    live: Sequence[TrackedTarget],
) -> PoseEstimate | None:
    """Look for a lost person at the predicted position, in rotated regions.

    A body that is curled up or upside down looks less like a body, so the estimate has to be near the prediction. An
    occluded person is not looked for, because something else is visible there; neither is one who has walked out of
    the image, or who is predicted near somebody else.

    :param image_rgb: (H, W, 3).
    :param live: the people who are tracked in this frame.
    :return: the estimate with the smallest innovation, or None.
    """
    if lost.is_occluded or share_in_image(lost.estimate, image_rgb) < LEAVING_SHARE:
        return None
    predicted = lost.predicted_region
    if any(target.estimate.next_region.is_near(predicted) for target in live):
        return None
    candidates = [
        replace(predicted, rotation=predicted.rotation + rotation, side_px=predicted.side_px * scale)
        for scale in _SCALES
        for rotation in _ROTATIONS
    ]
    regions = [region for region in candidates if is_in_image(region, image_rgb)]
    found = [e for e in landmarks.estimate(image_rgb, regions) if e.presence >= _MIN_PRESENCE]
    found = [e for e in found if e.spread >= CURLED_SPREAD and e.disagreement <= DISAGREEMENT_THRESHOLD]
    found = [e for e in found if is_center_in_image(e, image_rgb)]
    found = [e for e in found if not any(is_same_body(e, target.estimate) for target in live)]
    nearest = min(found, key=lost.innovation, default=None)
    return nearest if nearest is not None and lost.innovation(nearest) <= _MAX_INNOVATION else None
