# SPDX-License-Identifier: GPL-3.0-or-later
"""Keypoint jumps: keypoints that leave their path for a few frames and return, because the network
was mistaken.

To deviate from the straight line by D, and to be back on it a time τ after the last point on it,
takes an acceleration of at least

    a = 8 D / τ²,

as for a ball thrown up. If that is more than a person's limbs can reach, the keypoint is an
outlier. It is replaced by the point on the line, with less confidence. The largest network rarely
jumps, the smaller ones do where left and right are uncertain.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import BoolArray, Float64Array, FloatArray
from ...scene_gaps import usual_step_s
from ..perception.lifter import person_size
from .track import Track

MAX_ACCELERATION_M_S2 = 200.0  # a boxer's fist; more only at the moment in which it hits
MIN_JUMP_M = 0.06  # less is noise
MAX_JUMP_S = 0.12
MAX_JUMP_FRAMES = 8  # at a high frame rate
# By which the time from a frame to the next may differ from the usual one and still count as it:
# a share of it, or what the rounding of containers to milliseconds makes.
_SAME_STEP = 0.1
_SAME_STEP_S = 1.1e-3
CONFIDENCE = 0.3  # factor for a replaced keypoint
SPREAD_M = 0.5  # root mean square distance of a standing adult's limbs from their middle
SPREAD_S = 1.0  # window of the scale: people who bend for a moment do not shrink


def repair_keypoint_jumps(track: Track) -> Track:
    """Return the track with outlying keypoints and landmarks moved onto the straight line, see the
    module.
    """
    if len(track) < 3:
        return track
    in_image = find_keypoint_jumps(
        track.keypoints_px / scale_px_per_m(track)[:, None, None], track.seen, track.times
    )
    in_space = in_image | find_keypoint_jumps(track.world_landmarks, track.seen, track.times)
    if not in_space.any():
        return track
    return replace(
        track,
        keypoints_px=_interpolated(track.keypoints_px, in_image, track.seen, track.times),
        confidence=np.where(in_image, np.float32(CONFIDENCE) * track.confidence, track.confidence),
        world_landmarks=_interpolated(track.world_landmarks, in_space, track.seen, track.times),
    )


def find_keypoint_jumps(points: FloatArray, seen: BoolArray, times: Float64Array) -> BoolArray:
    """Find the points that jump.

    Only points that are seen without a gap from the frame before to the frame after count. They
    deviate by more than the distance of these two: a point that moves elsewhere and stays there
    does not jump.

    :param points: (T, J, n) metres.
    :param seen: (T,)
    :param times: (T,) seconds.
    :return: (T, J)
    """
    T, J = points.shape[:2]
    jumps = np.zeros((T, J), bool)
    if T < 3:
        return jumps
    step_s = max(usual_step_s(times), 1e-6)
    place = _places(times)
    for n in range(1, min(MAX_JUMP_FRAMES, T - 2) + 1):
        starts = place[: T - n - 1]
        length = place[n + 1 :] - starts
        # Of n frames at the rate that the window has.
        most = np.floor(MAX_JUMP_S / np.maximum(length / (n + 1) * step_s, 1e-6))
        possible = np.lib.stride_tricks.sliding_window_view(seen, n + 2).all(axis=1) & (n <= most)
        if not possible.any():
            continue
        least = np.maximum(MAX_ACCELERATION_M_S2 * (length * step_s) ** 2 / 8, MIN_JUMP_M)
        for j in range(J):
            p = points[:, j]
            before = p[: T - n - 1]
            after = p[n + 1 :]
            off = possible.copy()
            limit = np.maximum(np.linalg.norm(after - before, axis=1), least)
            for i in range(1, n + 1):
                share = (place[i : T - n - 1 + i] - starts) / length
                line = before + share.astype(points.dtype)[:, None] * (after - before)
                off &= np.linalg.norm(p[i : T - n - 1 + i] - line, axis=1) > limit
            for start in np.flatnonzero(off) + 1:
                jumps[start : start + n, j] = True
    return jumps


def _places(times: Float64Array) -> Float64Array:
    """Return when each of the frames (T,) is shown, in usual steps after the first one: their
    numbers at a constant frame rate, however the container rounds times.
    """
    usual_s = max(usual_step_s(times), 1e-6)
    steps_s = np.diff(times)
    is_usual = np.abs(steps_s - usual_s) <= max(_SAME_STEP * usual_s, _SAME_STEP_S)
    steps = np.where(is_usual, 1.0, np.maximum(steps_s / usual_s, 1e-6))
    return np.concatenate([[0.0], np.cumsum(steps)])


def scale_px_per_m(track: Track) -> Float64Array:
    """Estimate the (T,) pixels per metre at the person's distance, roughly, from the size of the
    body.
    """
    size = np.where(track.seen, person_size(track.keypoints_px), 0.0)
    reach = round(SPREAD_S / max(track.step_s, 1e-3)) if len(track) > 1 else 0
    padded = np.pad(size, reach, mode="edge")
    largest = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)
    return np.maximum(largest / SPREAD_M, 1e-3)


def _interpolated(
    values: FloatArray, jumps: BoolArray, seen: BoolArray, times: Float64Array
) -> FloatArray:
    """Return values (T, J, n) with those that jump interpolated in time between the frames before
    and after.
    """
    out = values.copy()
    place = _places(times)
    for j in np.flatnonzero(jumps.any(axis=0)):
        good = np.flatnonzero(seen & ~jumps[:, j])
        bad = np.flatnonzero(jumps[:, j])
        for k in range(values.shape[2]):
            out[bad, j, k] = np.interp(place[bad], place[good], values[good, j, k])
    return out
