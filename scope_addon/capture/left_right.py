# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds the frames of a clip in which the network took the person's left for the right, and puts them right.

The smaller networks do so for dozens of frames at a stretch, for most of a clip even, when a person's face does not
show. One frame does not tell, but the body does not turn round between two frames: at either end of such a stretch the
labels jump. Which side of a jump is right, the largest network says, which looked at a few frames (`tracker`). Its
judgement also corrects the landmarks in space round these frames, where the two networks are far apart.
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
TURN_COST_M = 0.005  # for reversing the depth on top
# Where the judge's landmarks are further off than this, they pull on those of the frames near by.
FAR_APART_M = 0.12
REACH_S = 0.13

AS_SAID, EXCHANGED, TURNED = 0, 1, 2  # TURNED: exchanged, and the depth reversed: the front taken for the back


def repair_left_right(track: Track) -> Track:
    """The track with left and right (and depth) as `find_labels` finds them, and corrected by the judged frames."""
    world = np.where(track.seen[:, None, None], track.world_landmarks, np.nan)
    judged = None
    if len(track.judged_rows):
        judged = np.full_like(world, np.nan)
        judged[track.judged_rows] = track.judged_landmarks
    labels = find_labels(world, track.acquired, judged, FRAME_COST_UNJUDGED_M if judged is None else FRAME_COST_M)
    del judged
    exchanged = labels != AS_SAID
    if not exchanged.any() and not len(track.judged_rows):
        return track
    repaired = labelled(world, labels)
    repaired += _pull(repaired, track)

    def exchange(values: np.ndarray) -> np.ndarray:
        out = values.copy()
        out[exchanged] = values[exchanged][:, SWAPPED]
        return out

    return replace(
        track,
        keypoints_px=exchange(track.keypoints_px),
        confidence=exchange(track.confidence),
        world_landmarks=np.where(track.seen[:, None, None], repaired, 0.0),
        hands=None if track.hands is None else _exchange_hands(track.hands, exchanged),
    )


def _exchange_hands(hands: np.ndarray, exchanged: np.ndarray) -> np.ndarray:
    return np.where(exchanged[:, None, None, None], hands[:, ::-1], hands)


def labelled(world_landmarks: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """World landmarks (T, 33, 3) with the labels (T,) of `find_labels` applied."""
    out = world_landmarks.copy()
    out[labels != AS_SAID] = world_landmarks[labels != AS_SAID][:, SWAPPED]
    out[labels == TURNED] *= [1.0, 1.0, -1.0]
    return out


def looks_swapped(before: np.ndarray, after: np.ndarray) -> bool:
    """Whether the world landmarks (33, 3) of two successive frames lie closer with left and right exchanged in one."""
    return bool(_distance(before[SWAPPED], after) < _distance(before, after))


def find_labels(
    world_landmarks: np.ndarray,
    starts: np.ndarray | None = None,
    judged: np.ndarray | None = None,
    frame_cost_m: float = FRAME_COST_M,
) -> np.ndarray:
    """How each frame's landmarks should be read, (T,) int: AS_SAID, EXCHANGED or TURNED.

    The labels x_t with the least

        Σ_t cost(x_t) + Σ_t d(w_{t−1}(x_{t−1}), w_t(x_t)) + Σ_{t judged} d(w_t(x_t), judged_t),

    d the mean distance of the shoulders, elbows, wrists, hips, knees and ankles; by dynamic programming (Viterbi).
    Without a judge a stretch that is wrong costs less than its two jumps only when most of the clip says otherwise, so
    the majority of frames decides.

    :param world_landmarks: (T, 33, 3) metres, hips at 0, camera axes; rows of NaN where nobody was seen.
    :param starts: (T,) bool, frames that need not continue the one before (the person was found anew).
    :param judged: (T, 33, 3) the same as a better network sees it; rows of NaN where it did not look.
    """
    count = len(world_landmarks)
    known = np.isfinite(world_landmarks[:, _LIMBS]).all(axis=(1, 2))
    own_cost = np.array([0.0, frame_cost_m, frame_cost_m + TURN_COST_M])
    same = np.arange(3)
    cost = np.zeros(3)
    came_from = np.zeros((count, 3), int)
    previous: np.ndarray | None = None
    for t in range(count):
        if not known[t]:
            came_from[t] = same
            continue
        body = _variants(world_landmarks[t])
        if previous is None or (starts is not None and starts[t]):
            came_from[t] = int(np.argmin(cost))
            cost = np.full(3, cost.min())
        else:
            total = cost[:, None] + _distance(previous[:, None], body[None])
            came_from[t] = total.argmin(axis=0)
            cost = total.min(axis=0)
        cost = cost + own_cost
        if judged is not None and np.isfinite(judged[t][_LIMBS]).all():
            cost = cost + _distance(body, judged[t])
        previous = body
    labels = np.zeros(count, int)
    state = int(np.argmin(cost))
    for t in range(count - 1, -1, -1):
        labels[t] = state if known[t] else AS_SAID
        state = int(came_from[t, state])
    return labels


def _variants(world_landmarks: np.ndarray) -> np.ndarray:
    """(3, 33, 3) one frame's landmarks as said, exchanged, turned."""
    exchanged = world_landmarks[SWAPPED]
    return np.stack([world_landmarks, exchanged, exchanged * [1.0, 1.0, -1.0]])


def _pull(world: np.ndarray, track: Track) -> np.ndarray:
    """(T, 33, 3) what to add to the landmarks so that they meet the judge's where the two are far apart.

    Linear in time between judged frames that are near each other, else falling to nothing within the reach.
    """
    judged = {
        int(row): landmarks
        for row, landmarks in zip(track.judged_rows, track.judged_landmarks, strict=True)
        if track.seen[row]
    }
    # at a low frame rate it would only make its own frame jump
    if not judged or len(track) < 2 or np.median(np.diff(track.times)) > REACH_S:
        return np.zeros_like(world)
    knots: list[float] = []
    values: list[np.ndarray] = []
    nothing = np.zeros(world.shape[1:])
    for row in sorted(judged):
        time = track.times[row]
        far = _distance(judged[row], world[row]) > FAR_APART_M
        if not knots or time - REACH_S > knots[-1] + REACH_S:
            if knots:
                knots.append(knots[-1] + REACH_S)
                values.append(nothing)
            knots.append(time - REACH_S)
            values.append(nothing)
        knots.append(time)
        values.append(judged[row] - world[row] if far else nothing)
    knots.append(knots[-1] + REACH_S)
    values.append(nothing)
    out = np.empty_like(world)
    for column, value in zip(out.reshape(len(out), -1).T, np.array(values).reshape(len(knots), -1).T, strict=True):
        column[:] = np.interp(track.times, knots, value)
    return out


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Mean distance of the limbs' landmarks of bodies (..., 33, 3)."""
    return np.linalg.norm((a - b)[..., _LIMBS, :], axis=-1).mean(axis=-1)
