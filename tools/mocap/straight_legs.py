# SPDX-License-Identifier: GPL-3.0-or-later
"""Straighter legs for CMU's takes, whose skeletons put the knees in front of where they are.

Nobody in them stands or walks with straight legs. Raw markers of two of CMU's own recordings
(02_05 and 01_01), with hips after Harrington et al. 2007, say where the joints should be, and
published gait curves how straight the legs of people are. For each take, with u the direction up
in the pelvis, s up along the shank, f ahead at right angles to the shank and to the line of the
hips, and a ahead at right angles to the line from hip to ankle in the plane of the leg:

    hip   += 25 mm u
    ankle += 9 mm f − 9 mm s
    knee  −= x cos²(φ / 2) a        φ the knee's flexion

x is the same in all frames of a take, and such that the 5th percentile of φ is the `FLEXED_DEG` of
its kind of motion; 10 mm are about 2.7 degrees of a straight leg. The legs of some walkers are
straight when they push off and bent by 20 to 30 degrees in front of the body, because their hips
are too far ahead. Instead of the first two steps, their hips move,

    hip += 8 mm u − 23 mm (left × u)

and the knee follows from the lengths l₁ and l₂ of thigh and shank, with d the distance from hip to
ankle: at (d² + l₁² − l₂²) / 2d along that line, and ahead of it. Pelvis, feet and timing stay.
Thigh and shank turn with their bones by the smallest rotation, so their turn about themselves is
kept; their lengths vary by 2-6 mm in a take.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...solver.errors import ShapeError
from ...solver.rotations import shortest_turn
from .joint_centres import SIDES, Points, dot, unit
from .kinds import named_kind
from .take import Take

HIP_UP_M = 0.025
ANKLE_AHEAD_M = 0.009
ANKLE_DOWN_M = 0.009
HIP_BACK_M = 0.023  # of walkers whose hips are too far ahead
HIP_BACK_UP_M = 0.008
LONGEST = 0.9995  # of thigh and shank together: the distance from hip to ankle
# 5th percentile of the knees' flexion in people, by kind of motion.
FLEXED_DEG = {"walk": 4.0, "stand": 4.0, "run": 12.0, "jump": 6.0}
OTHERS_FLEXED_DEG = 4.0
MOST_M = 0.045  # of x
OTHERS_MOST_M = 0.030  # of kinds that `FLEXED_DEG` lacks: people may bend their legs on purpose
# The same of the performers whose markers were compared.
MEASURED_MOST_M = {"cmu_01": 0.015, "cmu_02": 0.015}
# A 5th percentile below shows that CMU's solver held the knee at its limit of 0: x is 0.
SOLVER_LIMIT_DEG = 2.0
BENT_WALK_DEG = 12.0  # a walker whose 5th percentile is below this ...
TILTED_DEG = 19.0  # ... and whose median is further above it has the hips too far ahead
STRAIGHT_DEG = 8.0  # with less flexion, the plane of a leg is the pelvis's sagittal one ...
BENT_DEG = 25.0  # ... and with more, that of its three joints
REVERSIBLE_DEG = 15.0  # a knee bent by more than this points to where it points
BACKWARDS_DEG = -20.0  # no knee bends backwards this far: there, the sign is wrong
ROUNDS = 12  # halvings of the range of x


def straightened(take: Take) -> Take:
    """Return the take with hips, knees and ankles moved, thighs and shanks turned with their bones.

    :param take: of CMU's skeleton, metres, y up, with orientations.
    :raises ShapeError: when the take has no orientations, or lacks a joint of the legs.
    """
    if take.orientations is None:
        raise ShapeError(f"{take.name} has no orientations to straighten its legs by")
    names = ("hip", "knee", "ankle")
    before = {f"{side}_{name}": take.joint(f"{side}_{name}") for side in SIDES for name in names}
    up = take.orientations[:, take.index("pelvis"), :, 1]
    after = _straight_legs(before, up, named_kind(take.source, take.name), take.subject)
    positions = take.positions.copy()
    for joint, place in after.items():
        positions[:, take.index(joint)] = place
    orientations = take.orientations.copy()
    for side in SIDES:
        for upper, lower in (("hip", "knee"), ("knee", "ankle")):
            first = f"{side}_{upper}"
            second = f"{side}_{lower}"
            turn = shortest_turn(before[first] - before[second], after[first] - after[second])
            orientations[:, take.index(first)] = turn @ orientations[:, take.index(first)]
    return replace(take, positions=positions, orientations=orientations)


def flexion(hip: Points, knee: Points, ankle: Points, left: Points) -> NDArray[np.float64]:
    """Return the angle (T,) between thigh and shank in degrees, negative when bent backwards.

    :param hip: (T, 3) metres, as ``knee`` and ``ankle``.
    :param left: (T, 3) unit vectors to the person's left.
    """
    thigh = unit(hip - knee)
    shank = unit(knee - ankle)
    angle = np.degrees(np.arccos(np.clip((thigh * shank).sum(axis=-1), -1.0, 1.0)))
    return np.asarray(np.where(dot(np.cross(thigh, shank), left)[..., 0] < 0.0, -angle, angle))


def knee_flexions(legs: Mapping[str, Points]) -> NDArray[np.float64]:
    """Return the flexion (2, T) of the left and the right knee in degrees.

    :param legs: (T, 3) metres, hip, knee and ankle of both sides by name.
    """
    left = unit(legs["left_hip"] - legs["right_hip"])
    found = np.array([flexion(*_leg(legs, side), left) for side in SIDES])
    return np.where(found < BACKWARDS_DEG, -found, found)


def _straight_legs(
    legs: Mapping[str, Points], up: Points, kind: str, subject: str
) -> dict[str, Points]:  # fmt: skip
    """Return the joints of both legs after all steps; see the module's docstring."""
    flexed = np.percentile(knee_flexions(legs), [5, 50])
    is_tilted = kind == "walk" and flexed[0] < BENT_WALK_DEG and flexed[1] - flexed[0] > TILTED_DEG
    moved = _with_hips_back(legs, up) if is_tilted else _with_measured_joints(legs, up)
    if flexed[0] < SOLVER_LIMIT_DEG and not is_tilted:
        return moved
    target = FLEXED_DEG.get(kind, OTHERS_FLEXED_DEG)
    if is_tilted and np.percentile(knee_flexions(moved), 5) <= target:
        return moved
    least = 0.0
    most = MOST_M if kind in FLEXED_DEG else MEASURED_MOST_M.get(subject, OTHERS_MOST_M)
    left = unit(legs["left_hip"] - legs["right_hip"])  # hips that move alone leave it as it is
    for _ in range(ROUNDS):
        x = 0.5 * (least + most)
        result = with_knees_back(moved, left, x)
        if np.percentile(knee_flexions(result), 5) > target:
            least = x
        else:
            most = x
    return result


def _with_measured_joints(legs: Mapping[str, Points], up: Points) -> dict[str, Points]:
    """Return the legs with hips and ankles where the markers say they are."""
    left = unit(legs["left_hip"] - legs["right_hip"])
    found = dict(legs)
    for side in SIDES:
        shank = unit(legs[f"{side}_knee"] - legs[f"{side}_ankle"])
        ahead = unit(np.cross(left, shank))
        found[f"{side}_hip"] = legs[f"{side}_hip"] + HIP_UP_M * up
        moved = ANKLE_AHEAD_M * ahead - ANKLE_DOWN_M * shank
        found[f"{side}_ankle"] = legs[f"{side}_ankle"] + moved
    return found


def _with_hips_back(legs: Mapping[str, Points], up: Points) -> dict[str, Points]:
    """Return the legs with hips further back, and knees from the lengths of the bones."""
    left = unit(legs["left_hip"] - legs["right_hip"])
    found = dict(legs)
    for side in SIDES:
        hip, knee, ankle = _leg(legs, side)
        thigh = float(np.median(np.linalg.norm(hip - knee, axis=1)))
        shank = float(np.median(np.linalg.norm(knee - ankle, axis=1)))
        hip = hip + HIP_BACK_UP_M * up - HIP_BACK_M * np.cross(left, up)
        distance = np.linalg.norm(hip - ankle, axis=1, keepdims=True)
        reach = np.minimum(distance, LONGEST * (thigh + shank))
        along = (reach**2 + thigh**2 - shank**2) / (2.0 * reach)
        ahead = np.sqrt(np.maximum(thigh**2 - along**2, 0.0))
        found[f"{side}_hip"] = hip
        foot_of_knee = hip + along * distance / reach * unit(ankle - hip)
        found[f"{side}_knee"] = foot_of_knee + ahead * _ahead_of_leg(hip, knee, ankle, left)
    return found


def with_knees_back(legs: Mapping[str, Points], left: Points, x: float) -> dict[str, Points]:
    """Return the legs with knees moved back by ``x`` metres where they are straight.

    :param legs: (T, 3) metres, hip, knee and ankle of both sides by name, among others.
    :param left: (T, 3) unit vectors to the person's left.
    """
    found = dict(legs)
    for side in SIDES:
        hip, knee, ankle = _leg(legs, side)
        half = 0.5 * np.radians(flexion(hip, knee, ankle, left))[:, None]
        found[f"{side}_knee"] = knee - x * np.cos(half) ** 2 * _ahead_of_leg(hip, knee, ankle, left)
    return found


def _ahead_of_leg(hip: Points, knee: Points, ankle: Points, left: Points) -> Points:
    """Return the direction (T, 3) to which a knee points, at right angles to the line hip-ankle.

    It lies in the leg's own plane when the knee is bent, and in the pelvis's sagittal plane when it
    is nearly straight.
    """
    line = unit(hip - ankle)
    across = unit(left - line * dot(left, line))
    bend = np.abs(flexion(hip, knee, ankle, left))[:, None]
    own = np.cross(hip - knee, knee - ankle)
    is_reversed = (dot(own, across) < 0.0) & (bend < REVERSIBLE_DEG)
    own = np.where(is_reversed, -own, own)
    share = np.clip((bend - STRAIGHT_DEG) / (BENT_DEG - STRAIGHT_DEG), 0.0, 1.0)
    return np.asarray(np.cross(unit(share * unit(own) + (1.0 - share) * across), line))


def _leg(legs: Mapping[str, Points], side: str) -> tuple[Points, Points, Points]:
    return legs[f"{side}_hip"], legs[f"{side}_knee"], legs[f"{side}_ankle"]
