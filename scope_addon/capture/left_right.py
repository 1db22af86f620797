# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds the frames of a clip in which the network took the person's left for the right.

The smaller networks do so for dozens of frames at a stretch when a person is seen from behind. One frame does not
tell, but the body does not turn round between two frames: at either end of such a stretch the labels jump.
"""

from __future__ import annotations

import numpy as np

from .landmark_network import KEYPOINT_NAMES

_PARTNERS = {"left": "right", "right": "left"}
SWAPPED = np.array(
    [KEYPOINT_NAMES.index("_".join(_PARTNERS.get(word, word) for word in name.split("_"))) for name in KEYPOINT_NAMES]
)
"""(33,) number of each keypoint's mirror partner (of the nose: itself)."""

_LIMBS = np.array([11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28])
_FRAME_COST_M = 0.005  # what overruling the network costs per frame, as metres of jump


def find_swapped_frames(world_landmarks: np.ndarray, starts: np.ndarray | None = None) -> np.ndarray:
    """Frames whose left and right labels should be exchanged, (T,) bool.

    The labelling x_t (as said or exchanged) with the least ``Σ_t 0.005 m · x_t + Σ_t jump(x_{t−1}, x_t)``, where the
    jump is the mean distance of the shoulders, elbows, wrists, hips, knees and ankles between the two frames; by
    dynamic programming (Viterbi). A stretch that is wrong costs less than its two jumps only when most of the clip
    says otherwise, so the majority of frames decides.

    :param world_landmarks: (T, 33, 3) metres, hips at 0, camera axes; rows of NaN where nobody was seen.
    :param starts: (T,) bool, frames that need not continue the one before (another person may have been found).
    """
    count = len(world_landmarks)
    body = np.stack([world_landmarks[:, _LIMBS], world_landmarks[:, SWAPPED][:, _LIMBS]], axis=1)
    cost = np.zeros(2)
    came_from = np.zeros((count, 2), int)
    previous: np.ndarray | None = None
    for t in range(count):
        if not np.isfinite(body[t]).all():
            came_from[t] = (0, 1)
            continue
        if previous is None or (starts is not None and starts[t]):
            came_from[t] = int(np.argmin(cost))
            cost = np.full(2, cost.min())
        else:
            jump = np.linalg.norm(previous[:, None] - body[t][None], axis=-1).mean(axis=-1)
            total = cost[:, None] + jump
            came_from[t] = total.argmin(axis=0)
            cost = total.min(axis=0)
        cost = cost + (0.0, _FRAME_COST_M)
        previous = body[t]
    swapped = np.zeros(count, bool)
    state = int(np.argmin(cost))
    for t in range(count - 1, -1, -1):
        swapped[t] = bool(state) and bool(np.isfinite(body[t]).all())
        state = int(came_from[t, state])
    return swapped
