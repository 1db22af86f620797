# SPDX-License-Identifier: GPL-3.0-or-later
"""Goals for a rig's ankles, where its feet differ in shape from the body's.

A foot that rolls from the heel onto the ball rotates about the one that is on the floor, and that
point must not move. The ankle follows from either point i, heel or ball:

    a_i = G(p_i) + Y c_i − D q_i,      c_i = q_i − t s_i, with its height set to 0,

    p_i   the point on the body, metres, world frame
    s_i   from the body's ankle to the point, at rest;  q_i: the same on the rig
    s     the rig's leg length divided by the body's
    t     the scale of positions on the floor, usually s
    G(p)  t p, but the height is that of the rig's point at rest plus s times the rise of p above
          its height at rest
    D, Y  rotation of the foot from rest, and its rotation about the vertical alone (heading)

So a point that is at rest on the body is at rest on the rig. On a flat foot both goals are the
same: t times the body's ankle, at the height of the rig's ankle; so a longer foot extends at both
ends, and nothing jumps. The two goals are blended by a logistic function of the difference in
height of the points, in favour of the lower one. Neither point penetrates the floor, even where the
captured foot does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.rotations import exp
from ..edit.root_motion import about_z
from .skeleton import rotated

_LEVEL = np.array([1.0, 1.0, 0.0])
_SOFT_M = 0.004  # Scale of the logistic function of the difference in height of heel and ball.
_DROP_S = 4 / 30  # Time before and after, over which the pelvis is lowered.


@dataclass(frozen=True)
class FootRest:
    """Feet at rest, in metres of their own skeleton, world axes."""

    heel: NDArray[np.float64]  # (..., 3) from the ankle
    ball: NDArray[np.float64]  # (..., 3) from the ankle
    height: NDArray[np.float64]  # (...) of the ankle above the floor


def ankle_goal(
    source: FootRest,
    rig: FootRest,
    scales: NDArray[np.float64],
    turn: NDArray[np.float64],
    ankle: NDArray[np.float64],
    floor: float = 0.0,
    one_floor: bool = True,
) -> NDArray[np.float64]:
    """Compute the goals of the rig's ankles, for any number of frames and feet at once.

    :param source: the body's feet.
    :param rig: the rig's feet.
    :param scales: (3,), t, t and s.
    :param turn: (..., 3, 3) D, the rotation of both feet from rest.
    :param ankle: (..., 3) the body's, metres.
    :param floor: height of the body's floor, metres.
    :param one_floor: keep the feet above the floor; False on uneven ground.
    :return: (..., 3) metres.
    """
    yaw = _heading(turn)
    goals = []
    heights = []
    rolled = []
    for s, q in ((source.heel, rig.heel), (source.ball, rig.ball)):
        point = ankle + rotated(turn, s)
        rig_point = rotated(turn, q)
        # The height above its rest position on the floor.
        above = point[..., 2] - floor - (source.height + s[..., 2])
        place = scales * point
        place[..., 2] = scales[2] * above + rig.height + q[..., 2]
        goals.append(place + rotated(yaw, (q - scales * s) * _LEVEL) - rig_point)
        heights.append(above)
        rolled.append(rig_point[..., 2] - (rig.height + q[..., 2]))
    # A weight of 1 means that the ball is in contact.
    share = 1.0 / (1.0 + np.exp(np.clip((heights[1] - heights[0]) / _SOFT_M, -50, 50)))
    goal: NDArray[np.float64] = goals[0] + share[..., None] * (goals[1] - goals[0])
    if one_floor:
        goal[..., 2] = np.maximum(goal[..., 2], -np.minimum(rolled[0], rolled[1]))
    return goal


def flat_toes(
    toe: NDArray[np.float64],
    rest: NDArray[np.float64],
    ball: NDArray[np.float64],
    ball_rest: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Raise toes whose tips would penetrate the floor.

    A capture in which the toes never bend pushes them into the floor when the heel rises; here they
    stay flat on it.

    :param toe: (..., 3, 3) rotations of the toes from rest.
    :param rest: (..., 3) from ball to tip at rest, metres.
    :param ball: (..., 3) metres.
    :param ball_rest: (...) height of the ball at rest, metres.
    :return: (..., 3, 3) rotations of the toes from rest.
    """
    tip = rotated(toe, rest)
    length = np.maximum(np.sqrt((rest * rest).sum(axis=-1)), 1e-9)
    lowest = np.clip(rest[..., 2] - (ball[..., 2] - ball_rest), -length, length)
    across = np.hypot(tip[..., 0], tip[..., 1])
    # The axis is undefined for toes that point straight down.
    penetrates = (tip[..., 2] < lowest) & (across > 0.05 * length)
    if not penetrates.any():
        return toe
    angle = np.arcsin(np.clip(tip[..., 2] / length, -1, 1))
    lift = np.where(penetrates, np.arcsin(lowest / length) - angle, 0.0)
    side = (
        np.stack([tip[..., 1], -tip[..., 0], np.zeros_like(across)], axis=-1)
        / np.maximum(across, 1e-9)[..., None]
    )
    raised: NDArray[np.float64] = exp(side * lift[..., None]) @ toe
    return raised


def pelvis_drop(
    hips: NDArray[np.float64],
    goals: NDArray[np.float64],
    lengths: NDArray[np.float64],
    times: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Compute how far the pelvis has to be lowered, smoothly in time, for the legs to reach the
    goals of the ankles.

    :param hips: (T, L, 3) of L legs, metres.
    :param goals: (T, L, 3) of the ankles, metres.
    :param lengths: (L,) of the stretched legs, metres.
    :param times: (T,) seconds.
    :return: (T,) metres.
    """
    level = np.linalg.norm((goals - hips)[..., :2], axis=-1)
    upright = np.sqrt(np.maximum(lengths**2 - level**2, (0.5 * lengths) ** 2))
    needed: NDArray[np.float64] = np.maximum(0.0, (hips - goals)[..., 2] - upright).max(axis=1)
    if not needed.any() or len(needed) == 1:
        return needed
    # A maximum filter, then a weighted mean of the same width: nowhere less than needed, and
    # smooth.
    frames = round(_DROP_S / float(np.median(np.diff(times))))
    width = np.arange(-frames, frames + 1)
    near = np.clip(np.arange(len(needed))[:, None] + width, 0, len(needed) - 1)
    weight = 1 + np.cos(np.pi * width / (frames + 1))
    smooth: NDArray[np.float64] = needed[near].max(axis=1)[near] @ (weight / weight.sum())
    return smooth


def _heading(turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotations (..., 3, 3) about the vertical alone, from the sideways axis, which
    stays horizontal.
    """
    return about_z(np.arctan2(turn[..., 1, 0], turn[..., 0, 0])).reshape(turn.shape)
