# SPDX-License-Identifier: GPL-3.0-or-later
"""Repair of errors that networks typically make for a few frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .camera.intrinsics import Camera
from .perception.hand_landmarks import HAND_LENGTH_M, SIDES, pixels_per_metre
from .perception.landmark_network import KEYPOINT_NAMES
from .tracking.hand_assignment import confirmed
from .tracking.keypoint_jumps import repair_keypoint_jumps
from .tracking.left_right import repair_left_right
from .tracking.limb_swap import repair_limb_swaps
from .tracking.track import Track

SURE = 0.8  # confidence of a hand from which it counts
# Distances of its wrist from the body's, in hand lengths, up to which the body's is right, and from
# which it is wrong.
AGREED = 0.5
CONTRADICTED = 0.8
# Keypoints of the body, and those of a hand at the same places.
_BODY = np.array(
    [
        [KEYPOINT_NAMES.index(f"{s}_{n}") for n in ("wrist", "pinky", "index", "thumb")]
        for s in SIDES
    ]
)
_HAND = np.array([0, 17, 5, 2])


def repair(track: Track, camera: Camera) -> Track:
    """Undo left-right swaps and limb swaps, replace keypoint jumps, keep tentative hands that
    others support.

    Wrists go to hands that contradict them.
    """
    track = repair_limb_swaps(repair_left_right(track, camera))
    if track.hands is not None:
        track = wrists_at_hands(replace(track, hands=confirmed(track.hands, track.times)))
    return repair_keypoint_jumps(track)


def wrists_at_hands(track: Track) -> Track:
    """Return the track with wrists, and the body's three keypoints of the hand, at hands that
    contradict them.

    Where forearms cross, or a hand points at the camera, the body's network puts a wrist at the
    other hand or at the elbow, and is sure of it. The hand network looks more closely.
    """
    if track.hands is None or not track.seen.any():
        return track
    px = track.keypoints_px.copy()
    world = track.world_landmarks.copy()
    confidence = track.confidence.copy()
    scale = np.array([pixels_per_metre(*row) for row in zip(px, world, strict=True)])
    for side, points in enumerate(_BODY):
        hands = track.hands[:, side][:, _HAND]
        off = np.linalg.norm(hands[:, 0, :2] - px[:, points[0]], axis=-1) / np.maximum(
            HAND_LENGTH_M * scale, 1e-6
        )
        rows = np.flatnonzero(track.seen & (hands[:, 0, 2] >= SURE) & (off > AGREED) & (scale > 0))
        share = np.clip((off[rows] - AGREED) / (CONTRADICTED - AGREED), 0.0, 1.0)[:, None, None]
        at = np.ix_(rows, points)
        moved = share * (hands[rows, :, :2] - px[at])
        if track.has_depth:
            world[at] += np.pad(moved / scale[rows, None, None], ((0, 0), (0, 0), (0, 1)))
        px[at] += moved
        confidence[at] = np.minimum(confidence[at], hands[rows, :, 2])
    return replace(track, keypoints_px=px, world_landmarks=world, confidence=confidence)
