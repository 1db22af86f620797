# SPDX-License-Identifier: GPL-3.0-or-later
"""Aligning the feet with the floor: height, level, removing penetration, and the height of the
floor under a foot of which the user says that it rests there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.rotations import shortest_turn
from ..errors import UsageError
from ..kinematics.axes import UP
from ..kinematics.foot_skin import FootSkin
from ..kinematics.smoothing import gaussian_smooth
from ..kinematics.standing import standing_probability
from .clip import Clip, sample

_MAX_TILT = np.radians(20.0)  # A steeper plane through the soles is not the floor.
_MIN_SPREAD_M = 0.3  # Soles closer together do not show the slope of the floor.
_LIFT_CUTOFF_HZ = 3.0
LOWER = "lower"
_PARTS = {LOWER: slice(0, 4), "left": slice(0, 2), "right": slice(2, 4)}


def refloor(
    clip: Clip,
    body: Body,
    betas: NDArray[np.floating[Any]],
    *,
    level: bool = False,
    lift: bool = True,
    height: float = 0.0,
) -> Clip:
    """Move the motion so that the feet in contact are on the floor.

    :param betas: (P,) shape coefficients.
    :param level: also rotate the whole motion about the mean contact point so that the soles in
        contact lie in a horizontal plane, if they are spread widely enough to determine one.
    :param lift: also raise frames whose feet penetrate the floor, smoothly.
    :param height: z of the floor, metres.
    """
    soles = clip.soles(body, betas)
    weight = standing_probability(soles, UP, clip.times)
    out = clip.copy()
    if level:
        turn, middle = _levelling(soles, weight)
        out.rotations[:, 0] = turn @ out.rotations[:, 0]
        out.root = (out.root - middle) @ turn.T + middle
        soles = (soles - middle) @ turn.T + middle
    standing = weight > 0.5
    heights = soles[..., 2]
    floor = (
        float(np.median(heights[standing]))
        if standing.any()
        else float(np.median(heights.min(axis=1)))
    )
    out.root[:, 2] -= floor - height
    if lift:
        below = np.maximum(0.0, floor - heights.min(axis=1))
        smooth = gaussian_smooth(below, clip.times, _LIFT_CUTOFF_HZ)
        out.root[:, 2] += np.maximum(smooth, below)
    return out


def _levelling(
    soles: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fit a plane to the soles in contact and return the rotation that levels it.

    :param soles: (T, 4, 3) metres, world frame.
    :param weight: (T, 4) standing probabilities.
    :return: rotation (3, 3), and the point (3,) about which it rotates.
    """
    points = soles[weight > 0.5]
    w = weight[weight > 0.5]
    if len(points) < 3:
        return np.eye(3), np.zeros(3)
    middle = (w[:, None] * points).sum(0) / w.sum()
    values, vectors = np.linalg.eigh(
        (w[:, None] * (points - middle)).T @ (points - middle) / w.sum()
    )
    if np.sqrt(max(values[1], 0.0)) < _MIN_SPREAD_M / 2:
        return np.eye(3), middle
    normal = vectors[:, 0] * (1.0 if vectors[2, 0] > 0 else -1.0)
    if np.arccos(np.clip(normal @ UP, -1.0, 1.0)) > _MAX_TILT:
        return np.eye(3), middle
    return shortest_turn(normal, UP), middle


def foot_height(
    clip: Clip, body: Body, betas: NDArray[np.floating[Any]], time: float, foot: str
) -> float:
    """Return the height in metres of the lowest skin of a foot at a time.

    :param betas: (P,) shape coefficients.
    :param time: seconds, on the clip's clock.
    :param foot: "left", "right" or "lower", which is the lower one of the two.
    :raises UsageError: the foot is none of these.
    """
    if foot not in _PARTS:
        raise UsageError(f"the foot must be left, right or lower, not {foot!r}")
    betas = np.asarray(betas, float)
    at = sample(clip, np.array([time]))
    poses = body.forward_kinematics(at.rotations, at.root - body.rest_joints(betas)[0], betas)
    heights = FootSkin(body, betas).heights(*poses, UP)[0]
    return float(heights[_PARTS[foot]].min())
