# SPDX-License-Identifier: GPL-3.0-or-later
"""The offset between the clocks of two cameras, from a person's own motion or from the sound of
both.

Distances between parts of a body, and angles of its joints, are the same from every side. With
such signals s of both cameras, standardized, the offset of the second clock is

    tau = argmin over tau of mean over t, i of rho(s_i(t) - s'_i(t + tau)).

A person who hardly moves, or moves periodically, has several minima of nearly the same depth. One
who turns while walking also looks to both cameras alike a while apart, with the same errors of the
lifted body. So the best minima are returned, and `calibrate` takes the one to which all keypoints
fit best.

Where the sound gets louder in several bands at once, as with claps, steps and syllables, is the
same in both microphones, while levels, echoes and noise differ. With such onsets s of both, of mean
0,

    c(tau) = sum over t, bands of s(t) s'(t + tau) / sqrt(sum of s² · sum of s'²),

the sums over what both hear at an offset tau, the offset is where c is largest, if it stands out.
It is then measured in each part of the sound alone: the parts' spread gives its deviation, and a
line through them the drift.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...arrays import BoolArray, Float32Array, Float64Array
from ..media.sound import STEP_S as SOUND_STEP_S
from .bundle import DRIFT_SIGMA
from .seen_person import NAMES, SeenPerson

LONGEST_OFFSET_S = 60.0
STEP_S = 1.0 / 60.0
MIN_OVERLAP_S = 1.0
# Parts of the shorter clip that both cameras have to show.
MIN_OVERLAP = 0.3
# Between minima that count as different ones.
APART_S = 0.2
MOST_LIKELY = 4  # minima that are returned
_LAGS_PER_TICK = 100
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
_ONSET_STEPS = 5  # between the two moments whose loudness is compared: 10 ms
SOUND_OVERLAP_S = 2.0
# The largest correlation, in deviations of all: chance reaches 6 in an hour. And in parts of the
# largest one at another offset.
_STANDS_OUT = 9.0
_MARGIN = 1.3
SOUND_APART_S = 0.1  # of another offset
_PART_S = 10.0  # the least length of a part
_MOST_PARTS = 40
_NEAR_S = 0.06  # from the whole sound's offset, within which a part's is looked for
# Sound takes 5 ms for 1.7 m, by which the cameras' distances from its source may differ.
_PATH_SIGMA_S = 0.005
_LEAST_SIGMA_S = 0.002  # of one part
_ROUNDS = 10


def likely_offsets(
    first: SeenPerson, second: SeenPerson, tick: Callable[[], None] = lambda: None
) -> list[float]:
    """Return the time in the second camera's file less that in the first one's, of one and the same
    moment, seconds: what fits best first. The list is empty where no overlap is long enough.

    :param tick: called from time to time, because an hour of footage takes minutes.
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
        if lag % _LAGS_PER_TICK == 0:
            tick()
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


@dataclass(frozen=True)
class SoundOffset:
    """The time in a camera's file less that in the first camera's: ``seconds + drift * t``."""

    seconds: float
    drift: float
    sigma_s: float  # of the offset in the middle of what both hear


def offset_by_sound(first: Float32Array, second: Float32Array) -> SoundOffset | None:
    """Return the offset of the second camera's clock; None where the sounds do not tell it.

    :param first: (T, B) as `loudness` returns it. :param second: (T', B) likewise.
    """
    a = _onsets(first)
    b = _onsets(second)
    least = round(SOUND_OVERLAP_S / SOUND_STEP_S)
    if min(len(a), len(b)) < least:
        return None
    lags, correlation = _correlation(a, b, round(LONGEST_OFFSET_S / SOUND_STEP_S), least)
    best = int(np.argmax(correlation))
    others = np.abs(lags - lags[best]) * SOUND_STEP_S > SOUND_APART_S
    if not others.any():
        return None
    deviation = 1.4826 * np.median(np.abs(correlation - np.median(correlation)))
    if correlation[best] < _STANDS_OUT * deviation:
        return None
    if correlation[best] < _MARGIN * correlation[others].max():
        return None
    lag = _vertex(lags, -correlation, best)
    return _from_parts(a, b, lag)


def _onsets(loudness: Float32Array) -> Float64Array:
    """Return by how much louder each band gets (T, bands), as a share of its deviation."""
    rise = np.zeros(loudness.shape)
    change = loudness[_ONSET_STEPS:] - loudness[:-_ONSET_STEPS]
    rise[_ONSET_STEPS // 2 : len(rise) - (_ONSET_STEPS - _ONSET_STEPS // 2)] = np.maximum(change, 0)
    rise -= rise.mean(axis=0)
    return rise / np.maximum(rise.std(axis=0), 1e-6)


def _correlation(
    a: Float64Array, b: Float64Array, longest: int, least: int
) -> tuple[Float64Array, Float64Array]:
    """Return offsets (n,) of b against a, in steps, and how alike both are there (n,)."""
    size = 1 << int(np.ceil(np.log2(len(a) + len(b))))

    def crossed(x: Float64Array, y: Float64Array) -> Float64Array:
        """Return sum over t of x(t) y(t + lag), for lags from -len(x) + 1 to len(y) - 1."""
        product = np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)
        return np.concatenate([product[size - len(x) + 1 :], product[: len(y)]])

    lags = np.arange(-len(a) + 1, len(b))
    total = np.zeros(len(lags))
    for band in range(a.shape[1]):
        total += crossed(a[:, band], b[:, band])
    power_a = crossed(np.square(a).sum(axis=1), np.ones(len(b)))
    power_b = crossed(np.ones(len(a)), np.square(b).sum(axis=1))
    overlap = np.minimum(len(a), len(b) - lags) - np.maximum(0, -lags)
    used = (np.abs(lags) <= longest) & (overlap >= least)
    alike = total / np.sqrt(np.maximum(power_a * power_b, 1e-12))
    # Short overlaps are alike by chance.
    alike *= np.sqrt(overlap / overlap.max())
    return lags[used].astype(float), alike[used]


def _from_parts(a: Float64Array, b: Float64Array, lag: float) -> SoundOffset:
    """Return the offset by parts of the sound, of which each tells one.

    With the drift's prior of deviation σ_d, and parts at times t_i from their middle,

        d = Σ t_i τ_i / (Σ t_i² + σ² / σ_d²).
    """
    whole = round(lag)
    begin = max(0, -whole)
    end = min(len(a), len(b) - whole)
    count = int(np.clip((end - begin) * SOUND_STEP_S // _PART_S, 1, _MOST_PARTS))
    bounds = np.linspace(begin, end, count + 1).astype(int)
    near = round(_NEAR_S / SOUND_STEP_S)
    times = []
    offsets = []
    for start, stop in zip(bounds[:-1], bounds[1:], strict=True):
        lags = np.arange(whole - near, whole + near + 1)
        alike = np.array([_product(a, b, start, stop, each) for each in lags])
        best = int(np.argmax(alike))
        deviation = 1.4826 * np.median(np.abs(alike - np.median(alike)))
        if 0 < best < len(lags) - 1 and alike[best] > 3.0 * deviation:
            times.append(0.5 * (start + stop) * SOUND_STEP_S)
            offsets.append(SOUND_STEP_S * _vertex(lags.astype(float), -alike, best))
    if not offsets:
        return SoundOffset(
            lag * SOUND_STEP_S, 0.0, np.hypot(_PATH_SIGMA_S, SOUND_STEP_S * near / 2)
        )
    middle_s = float(np.mean(times))
    t = np.array(times) - middle_s
    tau = np.array(offsets)
    offset_s = float(np.median(tau))
    drift = 0.0
    for _ in range(_ROUNDS):
        error = tau - offset_s - drift * t
        sigma_s = max(_LEAST_SIGMA_S, 1.4826 * float(np.median(np.abs(error))))
        weight = 1.0 / (1.0 + np.square(error / sigma_s))
        offset_s = float(weight @ (tau - drift * t) / weight.sum())
        known = weight @ np.square(t) + (sigma_s / DRIFT_SIGMA) ** 2
        drift = float(weight @ (t * (tau - offset_s)) / known)
    sigma_s = float(np.hypot(_PATH_SIGMA_S, sigma_s / np.sqrt(weight.sum())))
    return SoundOffset(offset_s - drift * middle_s, drift, sigma_s)


def _product(a: Float64Array, b: Float64Array, start: int, stop: int, lag: int) -> float:
    first = max(start, -lag)
    last = min(stop, len(b) - lag)
    return float((a[first:last] * b[first + lag : last + lag]).sum()) if last > first else 0.0
