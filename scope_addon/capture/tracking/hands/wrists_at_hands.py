# SPDX-License-Identifier: GPL-3.0-or-later
"""The body's wrists, where hands that are surely seen contradict them.

Where forearms cross, or a hand points at the camera, the body's network puts a wrist at the other hand or at the elbow,
and is sure of it. The hand network looks more closely.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...perception.hand_landmarks import HAND_LENGTH_M, SIDES, pixels_per_metre
from ...perception.landmark_network import KEYPOINT_NAMES
from ..track import Track

SURE = 0.8  # confidence of a hand from which it counts
# Distances of its wrist from the body's, in hand lengths, up to which the body's is right, and from which it is wrong.
AGREED, CONTRADICTED = 0.5, 0.8
# Keypoints of the body, and those of a hand at the same places.
_BODY = np.array([[KEYPOINT_NAMES.index(f"{s}_{n}") for n in ("wrist", "pinky", "index", "thumb")] for s in SIDES])
_HAND = np.array([0, 17, 5, 2])


def wrists_at_hands(track: Track) -> Track:
    """Return the track with wrists, and the body's three keypoints of the hand, at hands that contradict them."""
    if track.hands is None or not track.seen.any():
        return track
    px, world, confidence = track.keypoints_px.copy(), track.world_landmarks.copy(), track.confidence.copy()
    scale = np.array([pixels_per_metre(*row) for row in zip(px, world, strict=True)])
    for side, points in enumerate(_BODY):
        hands = track.hands[:, side][:, _HAND]
        off = np.linalg.norm(hands[:, 0, :2] - px[:, points[0]], axis=-1) / np.maximum(HAND_LENGTH_M * scale, 1e-6)
        rows = np.flatnonzero(track.seen & (hands[:, 0, 2] >= SURE) & (off > AGREED) & (scale > 0))
        share = np.clip((off[rows] - AGREED) / (CONTRADICTED - AGREED), 0.0, 1.0)[:, None, None]
        at = np.ix_(rows, points)
        moved = share * (hands[rows, :, :2] - px[at])
        if track.has_depth:
            world[at] += np.pad(moved / scale[rows, None, None], ((0, 0), (0, 0), (0, 1)))
        px[at] += moved
        confidence[at] = np.minimum(confidence[at], hands[rows, :, 2])
    return replace(track, keypoints_px=px, world_landmarks=world, confidence=confidence)
