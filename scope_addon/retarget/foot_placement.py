# SPDX-License-Identifier: GPL-3.0-or-later
"""Placing a rig's feet where the body's are, scaled, by lowering the pelvis and solving the legs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ..kinematics.axes import R_WORLD_MODEL
from .feet import FootRest, ankle_goal, flat_toes, pelvis_drop
from .legs import solve_leg
from .skeleton import Skeleton, head_positions

_SOLE_M, _HEEL_M = 0.015, 0.02  # thickness of the sole, and length of the heel region


@dataclass(frozen=True)
class BodyFeet:
    """The captured body's feet, by side."""

    rest: dict[str, FootRest]
    ankles: dict[str, NDArray[np.float64]]  # (T, 3) metres, world frame


@dataclass(frozen=True)
class RigMotion:
    """A rig's motion in the world frame, metres. Notation as in ``transfer.py``."""

    turns: NDArray[np.float64]  # (T, B, 3, 3) D of each bone
    alignment: NDArray[np.float64]  # (B, 3, 3) A_b F
    rotations: NDArray[np.float64]  # (T, B, 3, 3) bone to world
    heads: NDArray[np.float64]  # (T, B, 3)


def body_feet(body: Body, rest: dict[str, FootRest], joints: NDArray[np.float64]) -> BodyFeet:
    """Collect the ankles of the body's motion.

    :param rest: of ``feet_at_rest``.
    :param joints: (T, K+1, 3) metres, world frame.
    """
    return BodyFeet(rest, {side: joints[:, body.joint_names.index(f"{side}_ankle")] for side in rest})


def feet_at_rest(body: Body, betas: NDArray[np.floating[Any]]) -> dict[str, FootRest]:
    """Measure the feet of the body at rest, by side.

    The heel is the rear end of what the foot, without its toes, stands on.

    :param betas: (P,) shape coefficients.
    """
    v, J = body.rest_vertices(betas) @ R_WORLD_MODEL.T, body.rest_joints(betas) @ R_WORLD_MODEL.T
    strongest = body.skin_joints[np.arange(len(v)), body.skin_weights.argmax(1)]
    low = float(v[:, 2].min())
    rest = {}
    for side in ("left", "right"):
        part = body.joint_names.index(f"{side}_ankle")
        ankle, ball = J[part], J[body.joint_names.index(f"{side}_foot")]
        sole = v[(strongest == part) & (v[:, 2] < low + _SOLE_M)]
        heel = sole[sole[:, 1] > sole[:, 1].max() - _HEEL_M].mean(axis=0) if len(sole) else ankle
        rest[side] = FootRest(np.array([*heel[:2], low]) - ankle, ball - ankle, float(ankle[2]) - low)
    return rest


def place_feet(
    rig: Skeleton,
    row: dict[str, int],
    motion: RigMotion,
    source: BodyFeet,
    scale: float,
    times: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Move the rig's ankles, and with them heels and balls, to where the body's are.

    :param row: the rig's bone of each body part.
    :param scale: the rig's leg length divided by the body's.
    :param times: (T,) seconds.
    :return: the changed rotations (T, B, 3, 3) and heads (T, B, 3).
    """
    world, heads = motion.rotations.copy(), motion.heads.copy()
    legs, goals = [], []
    for side in (side for side in ("left", "right") if f"{side}_ankle" in row):
        hip, knee, ankle = (row[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
        toe = row.get(f"{side}_foot")
        foot = _rig_foot(rig, motion.alignment[ankle], ankle, toe, source.rest[side], scale)
        goal = ankle_goal(source.rest[side], foot, scale, motion.turns[:, ankle], source.ankles[side])
        legs.append((hip, knee, ankle))
        goals.append(goal)
        if toe is not None:
            world[:, toe] = _toe_rotations(rig, motion, ankle, toe, foot, goal)
    if not legs:
        return world, heads
    hips = [leg[0] for leg in legs]
    rested = [[np.linalg.norm(rig.heads[b] - rig.heads[a]) for a, b in zip(leg, leg[1:], strict=False)] for leg in legs]
    lengths = 0.9995 * np.array(rested).sum(1)
    heads[..., 2] -= pelvis_drop(heads[:, hips], np.stack(goals, 1), lengths, times)[:, None]
    thighs, shins, ankles = (list(bones) for bones in zip(*legs, strict=True))
    joints = _rows(heads[:, thighs]), _rows(heads[:, shins]), _rows(heads[:, ankles])
    solved = solve_leg(_rows(world[:, thighs]), _rows(world[:, shins]), joints, _rows(np.stack(goals, 1)))
    world[:, thighs], world[:, shins] = (R.reshape(len(world), len(legs), 3, 3) for R in solved)
    placed = head_positions(rig, world)
    placed += (heads[:, hips[0]] - placed[:, hips[0]])[:, None]
    return world, placed


def _rows(of_legs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the entries (T·L, ...) of T frames and L legs, (T, L, ...), which are solved at once."""
    return of_legs.reshape(-1, *of_legs.shape[2:])


def _rig_foot(
    rig: Skeleton, AF: NDArray[np.float64], ankle: int, toe: int | None, source: FootRest, scale: float
) -> FootRest:
    """Measure the rig's foot; without a bone at the ball, its length is taken from the body's."""
    height = float(rig.heads[ankle, 2]) - rig.floor
    ball = AF @ ((rig.heads[toe] if toe is not None else rig.tails[ankle]) - rig.heads[ankle])
    length = float(np.linalg.norm(source.ball[:2]))
    share = float(np.linalg.norm(ball[:2])) / length
    if not 0.3 * scale < share < 3 * scale or ball @ source.ball < 0:
        share, ball = scale, np.array([*(scale * source.ball[:2]), -0.8 * height])
    heel = np.array([*(share * source.heel[:2]), -height])  # no bone ends at the heel: proportional to the body's
    return FootRest(heel, ball, height)


def _toe_rotations(
    rig: Skeleton, motion: RigMotion, ankle: int, toe: int, foot: FootRest, goal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the toe bone's rotations (T, 3, 3) in the world, with the toes above the floor.

    :param goal: (T, 3) the ankle's positions, metres.
    """
    ball = goal + motion.turns[:, ankle] @ foot.ball
    # The tails of imported bones may point anywhere, so the direction of the toes is taken from the foot.
    tip = foot.ball * [1, 1, 0] / np.linalg.norm(foot.ball[:2]) * np.linalg.norm(rig.tails[toe] - rig.heads[toe])
    flat = flat_toes(motion.turns[:, toe], tip, ball, foot.height + foot.ball[2])
    world: NDArray[np.float64] = flat @ motion.alignment[toe] @ rig.rotations[toe]
    return world
