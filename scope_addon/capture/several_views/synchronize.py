# SPDX-License-Identifier: GPL-3.0-or-later
"""The offset between the clocks of two cameras, from a person's own motion.

Distances between parts of a body, and angles of its joints, are the same from every side. With
such signals s of both cameras, standardized, the offset of the second clock is

    tau = argmin over tau of mean over t, i of rho(s_i(t) - s'_i(t + tau)).

A person who hardly moves, or moves periodically, has several minima of nearly the same depth, and
the offset is then unknown. Nearby minima are told apart and refined by `bundle`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import BoolArray, Float64Array
from .seen_person import NAMES, SeenPerson

STEP_S = 1.0 / 60.0
MIN_OVERLAP_S = 1.0
# Parts of the shorter clip that both cameras have to show.
MIN_OVERLAP = 0.3
# Between minima that count as different ones.
_APART_S = 0.2
# The next best minimum has to be this much worse; otherwise the offset is ambiguous.
_MARGIN = 0.1
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


@dataclass(frozen=True)
class Offset:
    """The time in a camera's file less the time in the first camera's, of one and the same
    moment.
    """

    seconds: float
    is_certain: bool  # no other offset explains the motion nearly as well


def offset_between(first: SeenPerson, second: SeenPerson, longest_s: float) -> Offset | None:
    """Return the offset of the second camera's clock; None where no overlap is long enough.

    :param longest_s: the largest offset that is looked for, either way, seconds.
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
        if abs(offset_s) > longest_s:
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
    if not offsets:
        return None
    cost = np.array(costs)
    offset = np.array(offsets)
    best = int(np.argmin(cost))
    others = np.abs(offset - offset[best]) > _APART_S
    is_certain = not others.any() or bool(cost[others].min() > cost[best] * (1.0 + _MARGIN))
    return Offset(_vertex(offset, cost, best), is_certain)


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
