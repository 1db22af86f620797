# SPDX-License-Identifier: GPL-3.0-or-later
"""The offset between the clocks of two cameras, from a person's own motion.

Distances between parts of a body, and angles of its joints, are the same from every side. With
such signals s of both cameras, standardized, the offset of the second clock is

    tau = argmin over tau of mean over t, i of rho(s_i(t) - s'_i(t + tau)).

A person who hardly moves, or moves periodically, has several minima of nearly the same depth. One
who turns while walking also looks to both cameras alike a while apart, with the same errors of the
lifted body. So the best minima are returned, and `calibrate` takes the one to which all keypoints
fit best.
"""

from __future__ import annotations

import numpy as np

from ...arrays import BoolArray, Float64Array
from .seen_person import NAMES, SeenPerson

LONGEST_OFFSET_S = 60.0
STEP_S = 1.0 / 60.0
MIN_OVERLAP_S = 1.0
# Parts of the shorter clip that both cameras have to show.
MIN_OVERLAP = 0.3
# Between minima that count as different ones.
APART_S = 0.2
MOST_LIKELY = 4  # minima that are returned
_WORSE = 1.25  # than the best one, as which others are not returned
_ROBUST = 1.0  # of the difference of standardized signals
_TO_OWN_SIDE = ("wrist", "shoulder"), ("wrist", "hip"), ("elbow", "hip"), ("ankle", "hip")
_TO_OTHER_SIDE = ("wrist", "wrist"), ("elbow", "elbow"), ("knee", "knee"), ("ankle", "ankle")
_CROSSED = ("wrist", "shoulder"), ("ankle", "hip")
# Pairs of keypoints, by their numbers, whose distance is a signal.
_PAIRS = [
    *[(f"{side}_{a}", f"{side}_{b}") for a, b in _TO_OWN_SIDE for side in ("left", "right")],
    *[(f"left_{a}", f"right_{b}") for a, b in (*_TO_OTHER_SIDE, *_CROSSED)],
    *[(f"right_{a}", f"left_{b}") for a, b in _CROSSED],
    *[(f"{side}_knee", f"{side}_shoulder") for side in ("left", "right")],
]
_STARTS = np.array([NAMES.index(a) for a, _ in _PAIRS])
_ENDS = np.array([NAMES.index(b) for _, b in _PAIRS])
_SHOULDERS = [NAMES.index(f"{side}_shoulder") for side in ("left", "right")]
_HIPS = [NAMES.index(f"{side}_hip") for side in ("left", "right")]
_LEAST_DEVIATION = 0.05  # of a signal, in lengths of the trunk, so that noise is not standardized


def likely_offsets(first: SeenPerson, second: SeenPerson) -> list[float]:
    """Return the time in the second camera's file less that in the first one's, of one and the same
    moment, seconds: what fits best first. None where no overlap is long enough.
    """
    clock = np.arange(first.times[0], first.times[-1], STEP_S)
    second_clock = np.arange(second.times[0], second.times[-1], STEP_S)
    signals, seen = _signals(first, clock)
    second_signals, second_seen = _signals(second, second_clock)
    shorter = min(len(clock), len(second_clock))
    least = max(round(MIN_OVERLAP_S / STEP_S), round(MIN_OVERLAP * shorter))
    offsets = []
    costs = []
    # Sample i of the second camera's signals is compared with sample i + lag of the first one's.
    for lag in range(-len(second_clock) + 1, len(clock)):
        offset_s = second.times[0] - first.times[0] - lag * STEP_S
        if abs(offset_s) > LONGEST_OFFSET_S:
            continue
        begin = max(0, lag)
        end = min(len(clock), len(second_clock) + lag)
        both = seen[begin:end] & second_seen[begin - lag : end - lag]
        if both.sum() < least:
            continue
        difference = signals[begin:end][both] - second_signals[begin - lag : end - lag][both]
        square = np.square(difference / _ROBUST)
        costs.append(float(np.mean(square / (1.0 + square))))
        offsets.append(offset_s)
    cost = np.array(costs)
    offset = np.array(offsets)
    likely: list[float] = []
    is_left = np.ones(len(cost), bool)
    while is_left.any() and len(likely) < MOST_LIKELY:
        best = int(np.argmin(np.where(is_left, cost, np.inf)))
        if cost[best] > _WORSE * cost.min():
            break
        likely.append(_vertex(offset, cost, best))
        is_left &= np.abs(offset - offset[best]) > APART_S
    return likely


def _vertex(shift: Float64Array, cost: Float64Array, best: int) -> float:
    """Return the minimum of the parabola through the best of the offsets and its neighbours."""
    if not 0 < best < len(shift) - 1:
        return float(shift[best])
    left, middle, right = cost[best - 1 : best + 2]
    curvature = left - 2.0 * middle + right
    move = 0.5 * (left - right) / curvature if curvature > 0 else 0.0
    step = shift[best + 1] - shift[best]
    return float(shift[best] + np.clip(move, -0.5, 0.5) * step)


def _signals(person: SeenPerson, clock: Float64Array) -> tuple[Float64Array, BoolArray]:
    """Return standardized signals (n, S) of a person at times (n,), and where they are known."""
    at = person.at(clock)
    points = at.points
    distance = np.linalg.norm(points[:, _STARTS] - points[:, _ENDS], axis=-1)
    size = np.median(np.linalg.norm(points[:, _SHOULDERS] - points[:, _HIPS], axis=-1))
    signals = distance / max(float(size), 1e-6)
    if not at.seen.any():
        return signals, at.seen
    mean = signals[at.seen].mean(axis=0)
    deviation = np.maximum(signals[at.seen].std(axis=0), _LEAST_DEVIATION)
    return (signals - mean) / deviation, at.seen
