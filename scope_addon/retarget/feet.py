# SPDX-License-Identifier: GPL-3.0-or-later
"""Feet of another shape that stand where the body's stand: the point that carries is held, be it heel or ball.

A foot that rolls from the heel onto the ball turns about whichever of them is on the floor. Each of the two gives a
place for the ankle,

    a_i = G(p_i) + Y c_i − D q_i,      q_i: from the rig's ankle to its heel or ball,   s_i: the body's,
    G(p) = s p, the heights counted from each one's own floor,      c_i = (q_i − s s_i) without its height,

with D the turn of the foot and Y its heading alone. On a flat foot both agree with the body's ankle, so that a longer
foot is longer at both ends and nothing jumps; a point that stands still on the body stands still on the rig. The lower
of the two decides, by a logistic of the difference in their heights. Neither gets below the floor, even where a
capture's foot does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.rotations import exp

_SOFT_M = 0.004  # over this difference in height, heel and ball share the foot
_PULL_S = 4 / 30  # over so long a time on both sides a pelvis that has to sink does so


@dataclass(frozen=True)
class FootRest:
    """One foot at rest, in metres of its own skeleton: joints' and points' places about the ankle, axes of the world.

    ``heel`` and ``ball`` are from the ankle; ``height`` is the ankle's above the floor.
    """

    heel: np.ndarray  # (3,)
    ball: np.ndarray  # (3,)
    height: float


def ankle_goal(
    source: FootRest, rig: FootRest, scale: float, turn: np.ndarray, ankle: np.ndarray, floor: float = 0.0
) -> np.ndarray:
    """(T, 3) where the rig's ankle belongs.

    :param turn: (T, 3, 3) D, of both feet from their rest; ankle: (T, 3) the body's, its floor at height ``floor``.
    """
    yaw = _heading(turn)
    goals, heights = [], []
    for s, q in ((source.heel, rig.heel), (source.ball, rig.ball)):
        point = ankle + turn @ s
        above = point[:, 2] - floor - (source.height + s[2])  # what it has left its place on the floor by
        place = scale * point
        place[:, 2] = scale * above + rig.height + q[2]
        goals.append(place + yaw @ ((q - scale * s) * [1, 1, 0]) - turn @ q)
        heights.append(above)
    share = 1.0 / (1.0 + np.exp(np.clip((heights[1] - heights[0]) / _SOFT_M, -50, 50)))  # 1: the ball carries
    goal = (1 - share)[:, None] * goals[0] + share[:, None] * goals[1]
    lowest = np.stack([goal[:, 2] + (turn @ q)[:, 2] - (rig.height + q[2]) for q in (rig.heel, rig.ball)]).min(axis=0)
    goal[:, 2] += np.maximum(0.0, -lowest)
    return goal


def flat_toes(toe: np.ndarray, rest: np.ndarray, ball: np.ndarray, ball_rest: float) -> np.ndarray:
    """(T, 3, 3) the toes' turns, raised where their tips would be in the floor.

    A body whose toes never bend drives them into the floor when its heel rises; on the floor they stay flat.

    :param toe: (T, 3, 3) turns from rest; rest: (3,) from ball to tip at rest; ball: (T, 3) with its height at rest.
    """
    tip = toe @ rest
    length = max(float(np.linalg.norm(rest)), 1e-9)
    lowest = np.clip(rest[2] - (ball[:, 2] - ball_rest), -length, length)
    across = np.hypot(tip[:, 0], tip[:, 1])
    angle = np.arcsin(np.clip(tip[:, 2] / length, -1, 1))
    lift = np.where(tip[:, 2] < lowest, np.arcsin(lowest / length) - angle, 0.0)
    lift = np.where(across > 0.05 * length, lift, 0.0)  # hanging straight down, no way up is the right one
    side = np.stack([tip[:, 1], -tip[:, 0], np.zeros(len(tip))], axis=1) / np.maximum(across, 1e-9)[:, None]
    return exp(side * lift[:, None]) @ toe


def sinking(hips: np.ndarray, goals: np.ndarray, lengths: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(T,) metres by which the pelvis has to come down for the legs to reach the ankles' places, smoothly.

    :param hips, goals: (T, L, 3) of L legs; lengths: (L,) stretched; times: (T,) seconds.
    """
    level = np.linalg.norm((goals - hips)[..., :2], axis=-1)
    upright = np.sqrt(np.maximum(lengths**2 - level**2, (0.5 * lengths) ** 2))
    needed = np.maximum(0.0, (hips - goals)[..., 2] - upright).max(axis=1)
    if not needed.any() or len(needed) == 1:
        return needed
    # The largest of the neighbourhood, then its mean over the same: nowhere less than needed, and no corner.
    frames = round(_PULL_S / float(np.median(np.diff(times))))
    width = np.arange(-frames, frames + 1)
    near = np.clip(np.arange(len(needed))[:, None] + width, 0, len(needed) - 1)
    weight = 1 + np.cos(np.pi * width / (frames + 1))
    return needed[near].max(axis=1)[near] @ (weight / weight.sum())


def _heading(turn: np.ndarray) -> np.ndarray:
    """(T, 3, 3) turns about the upright axis alone, by the sideways axis, which pitching leaves level."""
    angle = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
    return exp(np.stack([np.zeros_like(angle), np.zeros_like(angle), angle], axis=1))
