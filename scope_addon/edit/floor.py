# SPDX-License-Identifier: GPL-3.0-or-later
"""Putting the feet back on the floor: raising, levelling, and keeping them out of it."""

from __future__ import annotations

import numpy as np

from ...solver.body import Body
from ...solver.rotations import shortest_turn
from ..kinematics.smoothing import gaussian_smooth
from ..kinematics.standing import standing_probability
from .clip import Clip

UP = np.array([0.0, 0.0, 1.0])
_MOST_TILT = np.radians(20.0)  # beyond that the plane through the soles is no floor
_SPREAD_M = 0.3  # soles closer together than that say nothing about the floor's slope
_LIFT_CUTOFF_HZ = 3.0


def refloor(clip: Clip, body: Body, betas: np.ndarray, *, level: bool = False, lift: bool = True) -> Clip:
    """The motion moved so that its standing feet are on z = 0.

    :param level: also turn the whole motion so that the soles that stand lie in a level plane, as far as they are
        spread over the floor; about the middle of where they stood.
    :param lift: also raise the frames whose feet are below the floor, smoothly.
    """
    soles = clip.soles(body, betas)
    weight = standing_probability(soles, UP, clip.times)
    out = Clip(clip.times, clip.rotations.copy(), clip.root.copy())
    if level:
        turn, middle = _levelling(soles, weight)
        out.rotations[:, 0] = turn @ out.rotations[:, 0]
        out.root = (out.root - middle) @ turn.T + middle
        soles = (soles - middle) @ turn.T + middle
    standing = weight > 0.5
    heights = soles[..., 2]
    floor = float(np.median(heights[standing])) if standing.any() else float(np.median(heights.min(axis=1)))
    out.root[:, 2] -= floor
    if lift:
        below = np.maximum(0.0, floor - heights.min(axis=1))
        smooth = gaussian_smooth(below, clip.times, _LIFT_CUTOFF_HZ)
        out.root[:, 2] += np.maximum(smooth, below)
    return out


def _levelling(soles: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) about a point (3,) that lays the plane through the standing soles level."""
    points, w = soles[weight > 0.5], weight[weight > 0.5]
    if len(points) < 3:
        return np.eye(3), np.zeros(3)
    middle = (w[:, None] * points).sum(0) / w.sum()
    values, vectors = np.linalg.eigh((w[:, None] * (points - middle)).T @ (points - middle) / w.sum())
    if np.sqrt(max(values[1], 0.0)) < _SPREAD_M / 2:
        return np.eye(3), middle
    normal = vectors[:, 0] * (1.0 if vectors[2, 0] > 0 else -1.0)
    if np.arccos(np.clip(normal @ UP, -1.0, 1.0)) > _MOST_TILT:
        return np.eye(3), middle
    return shortest_turn(normal, UP), middle
