# SPDX-License-Identifier: GPL-3.0-or-later
"""Limb swaps: finds the frames in which left and right of the legs alone, or the arms alone, are
swapped.

Networks that know a body's left and right still confuse its legs where these pass each other. The
rest of the body is continuous then, so this comes after `left_right`, which considers all of it at
once.

The limbs' motion distinguishes them where they meet. Let f_t be the position of knees and ankles
(elbows and wrists) relative to the middle of the hips (shoulders), in metres, and their confidence,
read as the label x_t says: 0 as detected, 1 swapped. The labels minimize

    Σ_t swap · x_t + Σ_t change · [x_t ≠ x_{t−1}] + Σ_t r_t + Σ_{t in A} j_t,
    r_t = mean over the joints of min(limit, |f_t − p_t| / (σ₀ + σ₁ Δt)),
    p_t = f_{t−1} + a (f_{t−1} − f_{t−2}),

with a = max(0, 1 − Δt / τ) times the ratio of the two frames' durations, because at a low rate a
limb reverses before the next frame. j_t is the same as r_t for the distance from the reference
network's landmarks in the frames A, in units of σ_j. The solution is the cheapest path through
pairs of labels.

A swap has to pay for two changes and for every frame: a wrong repair is worse than none. At ten
frames per second, walking legs are so ambiguous that half of the swaps remain, below seven all of
them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...arrays import BoolArray, Float64Array, FloatArray, IndexArray
from ...kinematics.sequences import least_cost_path
from ..perception.landmark_network import KEYPOINT_NAMES
from .keypoint_jumps import scale_px_per_m
from .left_right import MIRROR_PARTNER, reorder_keypoints, swap_keypoints
from .track import Track

# σ₀ and σ₁ of the prediction
SIGMA_M = 0.02
SIGMA_M_S = 0.35
VELOCITY_S = 0.2  # τ
# The longest time between two frames: after it, a walking leg may be where the other one was.
MAX_STEP_S = 0.15
LIMIT = 6.0  # of one joint's residual
CHANGE_COST = 3.0
SWAP_COST = 0.3  # of a frame; above this rate, of 1 / 60 s
FASTEST_HZ = 60.0
M_PER_CONFIDENCE = 0.6  # an occluded joint stays occluded
REFERENCE_SIGMA_M = 0.1  # σ_j
_PARTNER = np.array([1, 0, 3, 2])  # of the joints below


@dataclass(frozen=True)
class _Limbs:
    """A pair of limbs; left and right alternate in each array of keypoint indices."""

    joints: IndexArray  # (4,) that are compared
    anchors: IndexArray  # (2,) whose middle their positions are relative to
    all_points: IndexArray  # that are swapped with them


def _indices(*parts: str) -> IndexArray:
    """Return the indices of these keypoints, left and right alternating."""
    return np.array(
        [KEYPOINT_NAMES.index(f"{side}_{part}") for part in parts for side in ("left", "right")]
    )


LEGS = _Limbs(
    _indices("knee", "ankle"), _indices("hip"), _indices("knee", "ankle", "heel", "foot_index")
)
ARMS = _Limbs(
    _indices("elbow", "wrist"),
    _indices("shoulder"),
    _indices("elbow", "wrist", "pinky", "index", "thumb"),
)


def repair_limb_swaps(track: Track) -> Track:
    """Return the track with legs and arms swapped where `find_limb_swaps` says so; hands go with
    the arms.
    """
    for limbs in (LEGS, ARMS):
        where = find_limb_swaps(track, limbs)
        if where.any():
            track = _swap(track, limbs, where)
    return track


def _swap(track: Track, limbs: _Limbs, where: BoolArray) -> Track:
    order = np.arange(len(KEYPOINT_NAMES))
    order[limbs.all_points] = MIRROR_PARTNER[limbs.all_points]
    track = swap_keypoints(track, where, order, with_hands=limbs is ARMS)
    if not track.has_depth:
        return track
    return replace(track, world_landmarks=reorder_keypoints(track.world_landmarks, where, order))


def find_limb_swaps(track: Track, limbs: _Limbs) -> BoolArray:
    """Find the frames in which left and right of these limbs are swapped, see the module's
    equation.

    :return: (T,)
    """
    where = np.zeros(len(track), bool)
    rows = np.flatnonzero(track.seen)
    if len(rows) < 3:
        return where
    features, reference = _features(track, limbs)
    f = np.stack([features, features[:, _PARTNER]])[:, rows]  # (2, N, 4, n): as detected, swapped
    swap_cost = SWAP_COST * min(1.0, FASTEST_HZ * track.step_s)
    label_cost = np.array([0.0, swap_cost]) + _reference_cost(f, reference[rows])
    cost = _continuity_cost(f, track.times[rows], track.acquired[rows])
    where[rows] = _cheapest(cost, label_cost)
    return where


def _features(track: Track, limbs: _Limbs) -> tuple[FloatArray, Float64Array]:
    """Return f: (T, 4, 3 or 4) x, y, (z,) confidence; and the reference network's (T, 4, 2 or 3),
    NaN elsewhere.
    """

    def from_anchor(points: FloatArray) -> FloatArray:
        return points[:, limbs.joints] - points[:, limbs.anchors].mean(axis=1, keepdims=True)

    dimensions = 3 if track.has_depth else 2
    in_image = from_anchor(track.keypoints_px) / scale_px_per_m(track)[:, None, None]
    depth = from_anchor(track.world_landmarks)[..., 2:dimensions]
    certainty = M_PER_CONFIDENCE * track.confidence[:, limbs.joints, None]
    reference = np.full((len(track), 4, dimensions), np.nan)
    reference[track.reference_rows] = from_anchor(track.reference_landmarks)[..., :dimensions]
    return np.concatenate([in_image, depth, certainty], axis=-1), reference


def _reference_cost(f: FloatArray, reference: Float64Array) -> FloatArray:
    """Return j_t by label, (N, 2); 0 in frames without a reference."""
    residual = (
        np.linalg.norm(f[..., : reference.shape[-1]] - reference, axis=-1) / REFERENCE_SIGMA_M
    )
    return np.where(np.isfinite(residual), np.minimum(residual, LIMIT), 0.0).mean(axis=-1).T


def _continuity_cost(f: FloatArray, times: Float64Array, acquired: BoolArray) -> Float64Array:
    """Return r_t and the cost of a change, (N, 2, 2, 2) by the labels of the frames t − 2, t − 1
    and t.

    0 where the person was found again, and without r_t after too long a step. The first frame's
    values are not used, and the second's do not depend on the frame before the first.
    """
    step = np.diff(times, prepend=times[0])
    step_before = np.concatenate([step[:1], step[:-1]])
    has_velocity = ~acquired & ~np.roll(acquired, 1) & (step_before > 0)
    extrapolation = np.maximum(1 - step / VELOCITY_S, 0.0) * step / np.maximum(step_before, 1e-6)
    extrapolation = np.where(has_velocity, extrapolation, 0.0)
    sigma = SIGMA_M + SIGMA_M_S * step
    cost = np.zeros((len(times), 2, 2, 2))
    for a, b, c in np.ndindex(2, 2, 2):
        last = np.roll(f[b], 1, axis=0)
        second_last = np.roll(f[a], 2, axis=0)
        off = f[c] - last - extrapolation[:, None, None] * (last - second_last)
        r = np.minimum(np.linalg.norm(off, axis=-1) / sigma[:, None], LIMIT).mean(axis=-1)
        cost[:, a, b, c] = np.where(
            acquired, 0.0, np.where(step > MAX_STEP_S, 0.0, r) + CHANGE_COST * (b != c)
        )
    return cost


def _cheapest(cost: Float64Array, label_cost: FloatArray) -> BoolArray:
    """Return the (N,) labels with the least total cost.

    A state of the path is a pair of successive labels, so the first label of a state is the second
    of the one before.

    :param cost: (N, 2, 2, 2) of three labels in a row.
    :param label_cost: (N, 2) of each label.
    """
    pairs = np.repeat(label_cost[1:, None], 2, axis=1)  # (N−1, 2, 2)
    pairs[0] += label_cost[0][:, None] + cost[1].mean(axis=0)
    # (N−2, a, b, b', c)
    switching = np.where(np.eye(2, dtype=bool)[:, :, None], cost[2:, :, :, None], np.inf)
    path = least_cost_path(pairs.reshape(-1, 4), switching.reshape(-1, 4, 4))
    return np.concatenate([path[:1] // 2, path % 2]).astype(bool)
