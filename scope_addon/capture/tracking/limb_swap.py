# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds the frames in which the legs alone, or the arms alone, have changed sides, and changes them back.

Networks that know a body's left and right still take one leg for the other where the legs pass each other. The rest of
the body then goes on as before, so this comes after `left_right`, which looks at all of it at once.

Which way a limb was going tells them apart where they meet. With f_t the place of knees and ankles (elbows and wrists)
from the middle of the hips (shoulders), in metres, and their confidence, all as x_t says (left and right as said, or
exchanged), the labels are those with the least

    Σ_t own · x_t + Σ_t change · [x_t ≠ x_{t−1}] + Σ_t r_t + Σ_{t judged} j_t,
    r_t = mean over the joints of min(most, |f_t − p_t| / (σ₀ + σ₁ Δt)),   p_t = f_{t−1} + a (f_{t−1} − f_{t−2}),

a = max(0, 1 − Δt / τ) times the ratio of the two frames' durations, for at a low rate a limb turns back before the next
frame; j_t the same for the distance from what the judge saw, over σ_j. By the cheapest path through pairs of labels.

An exchange has to pay for two changes and for every frame: a wrong repair is worse than none. At ten frames a second
walking legs leave so much doubt that half of what is exchanged stays so, below seven everything.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...kinematics.viterbi import cheapest_path
from ..perception.landmark_network import KEYPOINT_NAMES
from .keypoint_jumps import scale_px_per_m
from .left_right import MIRROR_PARTNER, exchanged, reordered
from .track import Track

SIGMA_M, SIGMA_M_S = 0.02, 0.35  # σ₀ and σ₁: of what a limb does against expectation
VELOCITY_S = 0.2  # τ
LONGEST_S = 0.15  # from one frame to the next: after that a walking leg may be where the other one was
MOST = 6.0  # what one joint can say against going on
CHANGE = 3.0
OWN = 0.3
M_PER_CONFIDENCE = 0.6  # what is hidden stays hidden
JUDGE_SIGMA_M = 0.1
_PARTNER = np.array([1, 0, 3, 2])  # of the joints below


@dataclass(frozen=True)
class _Limbs:
    """``joints`` (4,) that tell, left and right in turn; ``anchors`` (2,), whose middle they are seen from."""

    joints: np.ndarray
    anchors: np.ndarray
    all_points: np.ndarray  # that change sides with them


def _numbers(*parts: str) -> np.ndarray:
    """Of these keypoints, left and right in turn."""
    return np.array([KEYPOINT_NAMES.index(f"{side}_{part}") for part in parts for side in ("left", "right")])


LEGS = _Limbs(_numbers("knee", "ankle"), _numbers("hip"), _numbers("knee", "ankle", "heel", "foot_index"))
ARMS = _Limbs(_numbers("elbow", "wrist"), _numbers("shoulder"), _numbers("elbow", "wrist", "pinky", "index", "thumb"))


def repair_limb_swaps(track: Track) -> Track:
    """The track with legs and arms exchanged where `find_limb_swaps` says so; hands go with the arms."""
    for limbs in (LEGS, ARMS):
        where = find_limb_swaps(track, limbs)
        if where.any():
            track = _exchange(track, limbs, where)
    return track


def _exchange(track: Track, limbs: _Limbs, where: np.ndarray) -> Track:
    order = np.arange(len(KEYPOINT_NAMES))
    order[limbs.all_points] = MIRROR_PARTNER[limbs.all_points]
    track = exchanged(track, where, order, with_hands=limbs is ARMS)
    if not track.has_depth:
        return track
    return replace(track, world_landmarks=reordered(track.world_landmarks, where, order))


def find_limb_swaps(track: Track, limbs: _Limbs) -> np.ndarray:
    """(T,) bool, where left and right of these limbs have to be exchanged: see the module's equation."""
    where = np.zeros(len(track), bool)
    rows = np.flatnonzero(track.seen)
    if len(rows) < 3:
        return where
    places, judged = _places(track, limbs)
    f = np.stack([places, places[:, _PARTNER]])[:, rows]  # (2, N, 4, n): as said, exchanged
    own = np.array([0.0, OWN]) + _judgement(f, judged[rows])
    cost = _going_on(f, track.times[rows], track.acquired[rows])
    where[rows] = _cheapest(cost, own)
    return where


def _places(track: Track, limbs: _Limbs) -> tuple[np.ndarray, np.ndarray]:
    """(T, 4, 3 or 4) x, y, (z,) confidence of the module's equation, and the judge's (T, 4, 2 or 3), else NaN."""

    def from_anchor(points: np.ndarray) -> np.ndarray:
        return points[:, limbs.joints] - points[:, limbs.anchors].mean(axis=1, keepdims=True)

    deep = 3 if track.has_depth else 2
    in_picture = from_anchor(track.keypoints_px) / scale_px_per_m(track)[:, None, None]
    in_space = from_anchor(track.world_landmarks)[..., 2:deep]
    sureness = M_PER_CONFIDENCE * track.confidence[:, limbs.joints, None]
    judged = np.full((len(track), 4, deep), np.nan)
    judged[track.reference_rows] = from_anchor(track.reference_landmarks)[..., :deep]
    return np.concatenate([in_picture, in_space, sureness], axis=-1), judged


def _judgement(f: np.ndarray, judged: np.ndarray) -> np.ndarray:
    """(N, 2) how far the limbs are by label from where the judge saw them, over σ_j; 0 where it did not look."""
    far = np.linalg.norm(f[..., : judged.shape[-1]] - judged, axis=-1) / JUDGE_SIGMA_M
    return np.where(np.isfinite(far), np.minimum(far, MOST), 0.0).mean(axis=-1).T


def _going_on(f: np.ndarray, times: np.ndarray, acquired: np.ndarray) -> np.ndarray:
    """(N, 2, 2, 2) r_t and the price of a change, by the labels of the frame before the last, the last and this one.

    0 where the person was found anew, and r_t where too much time went by; the first frame's are of no use, the
    second's do not go by the one before.
    """
    step = np.diff(times, prepend=times[0])
    before = np.concatenate([step[:1], step[:-1]])
    followed = ~acquired & ~np.roll(acquired, 1) & (before > 0)
    keeps = np.where(followed, np.maximum(1 - step / VELOCITY_S, 0.0) * step / np.maximum(before, 1e-6), 0.0)
    sigma = SIGMA_M + SIGMA_M_S * step
    cost = np.zeros((len(times), 2, 2, 2))
    for a, b, c in np.ndindex(2, 2, 2):
        last, foregoing = np.roll(f[b], 1, axis=0), np.roll(f[a], 2, axis=0)
        off = f[c] - last - keeps[:, None, None] * (last - foregoing)
        r = np.minimum(np.linalg.norm(off, axis=-1) / sigma[:, None], MOST).mean(axis=-1)
        cost[:, a, b, c] = np.where(acquired, 0.0, np.where(step > LONGEST_S, 0.0, r) + CHANGE * (b != c))
    return cost


def _cheapest(cost: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(N,) bool labels with the least sum of ``cost`` (N, 2, 2, 2) by three labels in a row and ``own`` (N, 2).

    A state of the path is two labels in a row, so the first of one state is the second of the one before.
    """
    pairs = np.repeat(own[1:, None], 2, axis=1)  # (N−1, 2, 2)
    pairs[0] += own[0][:, None] + cost[1].mean(axis=0)
    switching = np.where(np.eye(2, dtype=bool)[:, :, None], cost[2:, :, :, None], np.inf)  # (N−2, a, b, b', c)
    path = cheapest_path(pairs.reshape(-1, 4), switching.reshape(-1, 4, 4))
    return np.concatenate([path[:1] // 2, path % 2]).astype(bool)
