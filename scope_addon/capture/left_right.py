# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds the frames of a clip in which the network took the person's left for the right, and puts them right.

The smaller networks do so for dozens of frames at a stretch, for most of a clip even, when a person's face does not
show. One frame does not tell, but the body does not turn round between two frames: at either end of such a stretch the
labels jump. Which side of a jump is right, the largest network says, which looked at a few frames (`tracker`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .landmark_network import KEYPOINT_NAMES
from .track import Track

_PARTNERS = {"left": "right", "right": "left"}
SWAPPED = np.array(
    [KEYPOINT_NAMES.index("_".join(_PARTNERS.get(word, word) for word in name.split("_"))) for name in KEYPOINT_NAMES]
)
"""(33,) number of each keypoint's mirror partner (of the nose: itself)."""

_LIMBS = np.array([11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28])
# What overruling the network costs per frame, as metres of jump. The largest network is right nearly always: only
# stretches of some ten frames are overruled, lest somebody who spins between two frames at a low rate is undone.
FRAME_COST_M = 0.005
FRAME_COST_UNJUDGED_M = 0.04


def repair_left_right(track: Track) -> Track:
    """The track with left and right exchanged in the frames that `find_swapped_frames` finds."""
    world = np.where(track.seen[:, None, None], track.world_landmarks, np.nan)
    judged = np.full_like(world, np.nan)
    judged[track.judged_rows] = track.judged_landmarks
    cost = FRAME_COST_M if len(track.judged_rows) else FRAME_COST_UNJUDGED_M
    swapped = find_swapped_frames(world, track.acquired, judged, cost)
    if not swapped.any():
        return track

    def exchanged(values: np.ndarray) -> np.ndarray:
        out = values.copy()
        out[swapped] = values[swapped][:, SWAPPED]
        return out

    return replace(
        track,
        keypoints_px=exchanged(track.keypoints_px),
        confidence=exchanged(track.confidence),
        world_landmarks=exchanged(track.world_landmarks),
    )


def looks_swapped(before: np.ndarray, after: np.ndarray) -> bool:
    """Whether the world landmarks (33, 3) of two successive frames lie closer with left and right exchanged in one."""
    return bool(_distance(before[SWAPPED], after) < _distance(before, after))


def find_swapped_frames(
    world_landmarks: np.ndarray,
    starts: np.ndarray | None = None,
    judged: np.ndarray | None = None,
    frame_cost_m: float = FRAME_COST_M,
) -> np.ndarray:
    """Frames whose left and right labels should be exchanged, (T,) bool.

    The labelling x_t (0 as said, 1 exchanged) with the least

        Σ_t frame_cost · x_t + Σ_t d(w_{t−1}(x_{t−1}), w_t(x_t)) + Σ_{t judged} d(w_t(x_t), judged_t),

    d the mean distance of the shoulders, elbows, wrists, hips, knees and ankles; by dynamic programming (Viterbi).
    Without a judge a stretch that is wrong costs less than its two jumps only when most of the clip says otherwise, so
    the majority of frames decides.

    :param world_landmarks: (T, 33, 3) metres, hips at 0, camera axes; rows of NaN where nobody was seen.
    :param starts: (T,) bool, frames that need not continue the one before (another person may have been found).
    :param judged: (T, 33, 3) the same as a better network sees it; rows of NaN where it did not look.
    """
    count = len(world_landmarks)
    body = np.stack([world_landmarks, world_landmarks[:, SWAPPED]], axis=1)
    known = np.isfinite(world_landmarks[:, _LIMBS]).all(axis=(1, 2))
    cost = np.zeros(2)
    came_from = np.zeros((count, 2), int)
    previous: np.ndarray | None = None
    for t in range(count):
        if not known[t]:
            came_from[t] = (0, 1)
            continue
        if previous is None or (starts is not None and starts[t]):
            came_from[t] = int(np.argmin(cost))
            cost = np.full(2, cost.min())
        else:
            total = cost[:, None] + _distance(previous[:, None], body[t][None])
            came_from[t] = total.argmin(axis=0)
            cost = total.min(axis=0)
        cost = cost + (0.0, frame_cost_m)
        if judged is not None and np.isfinite(judged[t][_LIMBS]).all():
            cost = cost + _distance(body[t], judged[t])
        previous = body[t]
    swapped = np.zeros(count, bool)
    state = int(np.argmin(cost))
    for t in range(count - 1, -1, -1):
        swapped[t] = bool(state) and bool(known[t])
        state = int(came_from[t, state])
    return swapped


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Mean distance of the limbs' landmarks of bodies (..., 33, 3)."""
    return np.linalg.norm((a - b)[..., _LIMBS, :], axis=-1).mean(axis=-1)
