# SPDX-License-Identifier: GPL-3.0-or-later
"""Keypoints that leap away for a few frames and come back, as when a network sees an arm in something else.

To stray from the straight way by D and be back on it n + 1 frames after the last one on it takes an acceleration of at
least

    a = 8 D / ((n + 1) Δt)²,

that of a ball thrown up. What would ask more than anybody's limbs can do was seen wrongly: such a keypoint goes on
along the straight way, with less confidence. The largest network leaps rarely, the smaller ones where left and right
are in doubt.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..perception.lifter import person_size
from .track import Track

MOST_M_S2 = 200.0  # a boxer's fist; more, but not for long, where it hits
LEAST_M = 0.06  # noise
LONGEST_S = 0.12
LONGEST_FRAMES = 8  # at a high frame rate
CONFIDENCE = 0.3  # share that is left
SPREAD_M = 0.5  # root mean square distance of a standing adult's limbs from their middle
SPREAD_S = 1.0  # people who bend for a moment do not shrink


def repair_keypoint_jumps(track: Track) -> Track:
    """The track with leaping keypoints and landmarks moved onto the straight way, see above."""
    if len(track) < 3:
        return track
    step_s = float(np.median(np.diff(track.times)))
    in_picture = find_keypoint_jumps(track.keypoints_px / scale_px_per_m(track)[:, None, None], track.seen, step_s)
    in_space = in_picture | find_keypoint_jumps(track.world_landmarks, track.seen, step_s)
    if not in_space.any():
        return track
    return replace(
        track,
        keypoints_px=_straightened(track.keypoints_px, in_picture, track.seen),
        confidence=np.where(in_picture, np.float32(CONFIDENCE) * track.confidence, track.confidence),
        world_landmarks=_straightened(track.world_landmarks, in_space, track.seen),
    )


def find_keypoint_jumps(points: np.ndarray, seen: np.ndarray, step_s: float) -> np.ndarray:
    """(T, J) which points (T, J, n), metres, leap; those seen without a gap from the frame before to the one after.

    They stray by more than the two are apart: what goes elsewhere and stays there does not leap.
    """
    T, J = points.shape[:2]
    leaps = np.zeros((T, J), bool)
    for n in range(1, min(LONGEST_FRAMES, int(LONGEST_S / max(step_s, 1e-6)), T - 2) + 1):
        least = max(MOST_M_S2 * ((n + 1) * step_s) ** 2 / 8, LEAST_M)
        whole = np.lib.stride_tricks.sliding_window_view(seen, n + 2).all(axis=1)
        for j in range(J):
            p = points[:, j]
            before, after = p[: T - n - 1], p[n + 1 :]
            off, far = whole.copy(), np.maximum(np.linalg.norm(after - before, axis=1), least)
            for i in range(1, n + 1):
                way = before + (i / (n + 1)) * (after - before)
                off &= np.linalg.norm(p[i : T - n - 1 + i] - way, axis=1) > far
            for start in np.flatnonzero(off) + 1:
                leaps[start : start + n, j] = True
    return leaps


def scale_px_per_m(track: Track) -> np.ndarray:
    """(T,) pixels that a metre takes at the person's distance, roughly."""
    size = np.where(track.seen, person_size(track.keypoints_px), 0.0)
    near = round(SPREAD_S / max(float(np.median(np.diff(track.times))), 1e-3)) if len(track) > 1 else 0
    padded = np.pad(size, near, mode="edge")
    largest = np.lib.stride_tricks.sliding_window_view(padded, 2 * near + 1).max(axis=1)
    return np.maximum(largest / SPREAD_M, 1e-3)


def _straightened(values: np.ndarray, leaps: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Values (T, J, n) with those that leap interpolated between the frames before and after."""
    out, rows = values.copy(), np.arange(len(values))
    for j in np.flatnonzero(leaps.any(axis=0)):
        good = np.flatnonzero(seen & ~leaps[:, j])
        bad = np.flatnonzero(leaps[:, j])
        for k in range(values.shape[2]):
            out[bad, j, k] = np.interp(rows[bad], good, values[good, j, k])
    return out
