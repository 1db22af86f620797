# SPDX-License-Identifier: GPL-3.0-or-later
"""Placing a rig's feet where the body's are, scaled, by lowering the pelvis and solving the
legs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from .feet import FootRest, ankle_goal, flat_toes, pelvis_drop
from .legs import solve_leg
from .skeleton import Skeleton, head_positions, rotated

# Thickness of the sole, and length of the heel region.
_SOLE_M = 0.015
_HEEL_M = 0.02
_REACH = 0.9995  # Share of a leg's length beyond which the pelvis is lowered.
_SIDES = ("left", "right")


@dataclass(frozen=True)
class Legs:
    """The L legs of a rig that have an ankle, beside the body's, at rest. Bones are the rig's, by
    index.
    """

    hips: list[int]
    knees: list[int]
    ankles: list[int]
    joints: list[int]  # the body's ankles
    toed: list[int]  # the legs that have a bone for the toes
    toes: list[int]  # these bones
    body: FootRest  # (L, 3) and (L,)
    rig: FootRest
    tips: NDArray[np.float64]  # (len(toed), 3) from the ball to the tip of the toes, metres
    lengths: NDArray[np.float64]  # (L,) of the legs, nearly stretched, metres
    # (3,) scale of positions: that on the floor twice, and the ratio of leg lengths, rig to body.
    scales: NDArray[np.float64]


@dataclass(frozen=True)
class RigMotion:
    """A rig's motion in the world frame, metres. Notation as in ``transfer.py``."""

    turns: NDArray[np.float64]  # (T, B, 3, 3) D of each bone
    alignment: NDArray[np.float64]  # (B, 3, 3) A_b F
    rotations: NDArray[np.float64]  # (T, B, 3, 3) bone to world
    heads: NDArray[np.float64]  # (T, B, 3)


def legs_at_rest(
    rig: Skeleton,
    row: dict[str, int],
    alignment: NDArray[np.float64],
    body: Body,
    rest: tuple[NDArray[np.float64], NDArray[np.float64]],
    scales: NDArray[np.float64],
) -> Legs | None:
    """Measure the legs of a rig and of the body at rest; None if the rig has no ankles.

    :param row: the rig's bone of each body part.
    :param alignment: (B, 3, 3) A_b F.
    :param rest: the body's vertices (V, 3) and joints (K+1, 3) at rest, metres, world axes.
    :param scales: (3,) of positions on the floor, twice, and the rig's leg length divided by the
        body's.
    """
    sides = [side for side in _SIDES if f"{side}_ankle" in row]
    if not sides:
        return None
    hips, knees, ankles = (
        [row[f"{side}_{part}"] for side in sides] for part in ("hip", "knee", "ankle")
    )
    toe_of = [row.get(f"{side}_foot") for side in sides]
    source = _body_feet(body, *rest, sides)
    pairs = zip(ankles, toe_of, source, strict=True)
    feet = [
        _rig_foot(rig, alignment[ankle], ankle, toe, foot, float(scales[2]))
        for ankle, toe, foot in pairs
    ]
    toed = [leg for leg, toe in enumerate(toe_of) if toe is not None]
    toes = [toe for toe in toe_of if toe is not None]
    sizes = [np.linalg.norm(rig.ends[toe] - rig.heads[toe]) for toe in toes]
    # What toes end at may lie above or below them, so their direction is taken from the foot.
    tips = [
        feet[leg].ball * [1, 1, 0] / np.linalg.norm(feet[leg].ball[:2]) * size
        for leg, size in zip(toed, sizes, strict=True)
    ]
    places = rig.heads[[hips, knees, ankles]]  # (3, L, 3)
    return Legs(
        hips=hips,
        knees=knees,
        ankles=ankles,
        joints=[body.joint_names.index(f"{side}_ankle") for side in sides],
        toed=toed,
        toes=toes,
        body=_stacked(source),
        rig=_stacked(feet),
        tips=np.array(tips).reshape(-1, 3),
        lengths=_REACH * np.linalg.norm(np.diff(places, axis=0), axis=2).sum(axis=0),
        scales=scales,
    )


def _body_feet(
    body: Body, v: NDArray[np.float64], J: NDArray[np.float64], sides: list[str]
) -> list[FootRest]:
    """Measure the feet of the body at rest. The heel is the rear end of what the foot, without its
    toes, stands on.
    """
    low = float(v[:, 2].min())
    feet = []
    for side in sides:
        part = body.joint_names.index(f"{side}_ankle")
        ankle = J[part]
        ball = J[body.joint_names.index(f"{side}_foot")]
        sole = v[(body.strongest_joints == part) & (v[:, 2] < low + _SOLE_M)]
        heel = sole[sole[:, 1] > sole[:, 1].max() - _HEEL_M].mean(axis=0) if len(sole) else ankle
        feet.append(FootRest(np.array([*heel[:2], low]) - ankle, ball - ankle, ankle[2] - low))
    return feet


def _rig_foot(
    rig: Skeleton,
    AF: NDArray[np.float64],
    ankle: int,
    toe: int | None,
    source: FootRest,
    scale: float,
) -> FootRest:
    """Measure the rig's foot; without a bone at the ball, its length is taken from the body's."""
    height = rig.heads[ankle, 2] - rig.floor
    ball = AF @ ((rig.heads[toe] if toe is not None else rig.ends[ankle]) - rig.heads[ankle])
    length = float(np.linalg.norm(source.ball[:2]))
    share = float(np.linalg.norm(ball[:2])) / length
    if not 0.3 * scale < share < 3 * scale or ball @ source.ball < 0:
        share = scale
        ball = np.array([*(scale * source.ball[:2]), -0.8 * height])
    # No bone ends at the heel, so its position is proportional to the body's.
    heel = np.array([*(share * source.heel[:2]), -height])
    return FootRest(heel, ball, height)


def _stacked(feet: list[FootRest]) -> FootRest:
    """Return several feet as one, with their number as the first axis."""
    heels, balls, heights = zip(
        *((foot.heel, foot.ball, foot.height) for foot in feet), strict=True
    )
    return FootRest(np.array(heels), np.array(balls), np.array(heights))


def place_feet(
    rig: Skeleton,
    legs: Legs,
    motion: RigMotion,
    joints: NDArray[np.float64],
    times: NDArray[np.float64],
    one_floor: bool = True,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Move the rig's ankles, and with them heels and balls, to where the body's are.

    :param joints: (T, K+1, 3) of the body, metres, world frame.
    :param times: (T,) seconds.
    :param one_floor: keep feet and toes above the floor; False on uneven ground.
    :return: the changed rotations (T, B, 3, 3) and heads (T, B, 3).
    """
    world = motion.rotations.copy()
    heads = motion.heads.copy()
    turns = motion.turns[:, legs.ankles]
    goals = ankle_goal(
        legs.body, legs.rig, legs.scales, turns, joints[:, legs.joints], one_floor=one_floor
    )
    if legs.toed and one_floor:
        balls = (goals + rotated(turns, legs.rig.ball))[:, legs.toed]
        rested = (legs.rig.height + legs.rig.ball[:, 2])[legs.toed]
        flat = flat_toes(motion.turns[:, legs.toes], legs.tips, balls, rested)
        world[:, legs.toes] = flat @ (motion.alignment[legs.toes] @ rig.rotations[legs.toes])
    heads[..., 2] -= pelvis_drop(heads[:, legs.hips], goals, legs.lengths, times)[:, None]
    at = _rows(heads[:, legs.hips]), _rows(heads[:, legs.knees]), _rows(heads[:, legs.ankles])
    left = _rows(motion.turns[:, legs.hips, :, 0])  # The axis about which the body's knees bend.
    thighs = _rows(world[:, legs.hips])
    shins = _rows(world[:, legs.knees])
    solved = solve_leg(thighs, shins, at, _rows(goals), left)
    world[:, legs.hips], world[:, legs.knees] = (R.reshape(len(world), -1, 3, 3) for R in solved)
    placed = head_positions(rig, world)
    first = legs.hips[0]
    placed += (heads[:, first] - placed[:, first])[:, None]
    return world, placed


def _rows(of_legs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the entries (T·L, ...) of T frames and L legs, (T, L, ...), which are solved at
    once.
    """
    return of_legs.reshape(-1, *of_legs.shape[2:])
