# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations and place of another skeleton that moves as the body does.

With D_i(t) the turn of body part i away from its T-pose in the world, R_b the rest orientation of bone b, F the turn
about the upright axis that lets the rig face as the body does, and A_b the smallest turn, after its parent's, that lays
the rested limb along the body's own,

    R_world_bone(t) = D_i(t) A_b F R_b.

So a limb's direction is the body's whatever pose the rig rests in, and its twist is the one it rests with. Trunk and
head keep the posture in which the rig was built (A_b = I); feet turn about the upright axis alone, so soles stay flat.
Where fingers are captured and the rig has them, the palms lie on each other too, so that fingers bend about the right
axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.rotations import exp, shortest_turn
from ..edit.clip import Clip, interpolate_rotations
from ..kinematics.axes import R_WORLD_MODEL
from .bone_map import FINGERS, SPINE, BoneMap
from .feet import FootRest, ankle_goal, flat_toes, sinking
from .legs import reach

UP = np.array([0.0, 0.0, 1.0])
_NEXT = {"hip": "knee", "knee": "ankle", "shoulder": "elbow", "elbow": "wrist", "wrist": "hand"}
_NEXT |= {f"{finger}{k}": f"{finger}{k + 1}" for finger in FINGERS for k in (1, 2, 3)}  # the fourth is nobody's
_MOST_TURN = np.radians(100)  # between two palms at rest; beyond it a finger was taken for another one
_SOLE_M, _HEEL_M = 0.015, 0.02  # the sole's thickness, and how long a piece of it is the heel


@dataclass(frozen=True)
class Skeleton:
    """The mapped bones of a rig in its rest pose, in the world (z up, metres), parents before children.

    ``parents`` are the mapped bones with which each one turns, -1 where it turns with none; ``carriers`` those with
    which its head goes, which are others where a bone does not inherit rotation.
    """

    names: list[str]
    parents: NDArray[np.float64]  # (B,)
    carriers: NDArray[np.float64]  # (B,)
    heads: NDArray[np.float64]  # (B, 3)
    tails: NDArray[np.float64]  # (B, 3)
    rotations: NDArray[np.float64]  # (B, 3, 3) bone to world
    floor: float = 0.0  # height on which the rig rests


@dataclass(frozen=True)
class Pose:
    """A skeleton's motion in the world: rotations (T, B, 3, 3), heads (T, B, 3) metres.

    ``facing``: radians about the upright axis from where the rested rig faces to where the rested body does.
    """

    rotations: NDArray[np.float64]
    heads: NDArray[np.float64]
    facing: float


def transfer(
    clip: Clip, body: Body, betas: NDArray[np.float64], rig: Skeleton, bone_map: BoneMap, *, feet: bool = True
) -> Pose:
    """The rig's motion.

    :param feet: let the feet stand where the body's do, scaled by the ratio of leg lengths; bends the legs a little.
    """
    names = list(body.joint_names)
    index = {part: names.index(part) for part in names}
    rest = body.rest_joints(betas) @ R_WORLD_MODEL.T
    R, joints = body.forward_kinematics(clip.rotations, clip.root - body.rest_joints(betas)[0], betas)
    D = R @ R_WORLD_MODEL.T
    row = {part: rig.names.index(bone) for bone, part in bone_map.parts.items() if bone in rig.names}
    part_of = [bone_map.parts[name] for name in rig.names]
    F = _facing(rig, row)
    A = _rest_alignment(rig, part_of, row, rest, index, F)
    turns = _turns(D, rig, part_of, index)
    world = turns @ (A @ F @ rig.rotations)

    def leg_length(points: NDArray[np.float64], rows: dict[str, int], side: str) -> float:
        hip, knee = points[rows[f"{side}_hip"]], points[rows[f"{side}_knee"]]
        shin = rows.get(f"{side}_ankle")
        end = points[shin] if shin is not None else knee + (knee - hip)
        return float(np.linalg.norm(knee - hip) + np.linalg.norm(end - knee))

    source_rows = {part: index[part] for part in row}
    sides = ("left", "right")
    scale = sum(leg_length(rig.heads, row, s) for s in sides) / sum(leg_length(rest, source_rows, s) for s in sides)
    heads = _positions(rig, world)
    hips = [row["left_hip"], row["right_hip"]]
    source_hips = joints[:, [index["left_hip"], index["right_hip"]]].mean(axis=1)
    sole = _sole_height(body, betas)
    # Both stand on their floors at rest: heights count from there.
    lift = np.zeros(3)
    rested = rest[[index["left_hip"], index["right_hip"]], 2].mean() - sole
    lift[2] = (rig.heads[hips, 2].mean() - rig.floor) - scale * rested
    heads += (scale * source_hips + lift - heads[:, hips].mean(axis=1))[:, None]
    if feet:
        _stand(rig, row, world, heads, turns, A @ F, body, betas, joints, scale, clip.times)
    return Pose(world, heads, float(np.arctan2(F[1, 0], F[0, 0])))


def _stand(
    rig: Skeleton,
    row: dict[str, int],
    world: NDArray[np.float64],
    heads: NDArray[np.float64],
    turns: NDArray[np.float64],
    AF: NDArray[np.float64],
    body: Body,
    betas: NDArray[np.float64],
    joints: NDArray[np.float64],
    scale: float,
    times: NDArray[np.float64],
) -> None:
    """Bring the ankles, and with them heels and balls, to where the body's are; in place."""
    index = {part: k for k, part in enumerate(body.joint_names)}
    sides = [side for side in ("left", "right") if f"{side}_ankle" in row]
    feet = body_feet(body, betas)
    legs, goals = [], []
    for side in sides:
        hip, knee, ankle = (row[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
        own = _rig_foot(rig, AF[ankle], ankle, row.get(f"{side}_foot"), feet[side], scale)
        legs.append((hip, knee, ankle))
        goals.append(ankle_goal(feet[side], own, scale, turns[:, ankle], joints[:, index[f"{side}_ankle"]]))
        toe = row.get(f"{side}_foot")
        if toe is not None:
            ball = goals[-1] + turns[:, ankle] @ own.ball
            # Imported bones' tails may point anywhere; the toes lie as the foot does.
            tip = own.ball * [1, 1, 0] / np.linalg.norm(own.ball[:2]) * np.linalg.norm(rig.tails[toe] - rig.heads[toe])
            flat = flat_toes(turns[:, toe], tip, ball, own.height + own.ball[2])
            world[:, toe] = flat @ AF[toe] @ rig.rotations[toe]
    if not legs:
        return
    hips = [leg[0] for leg in legs]
    rested = [[np.linalg.norm(rig.heads[b] - rig.heads[a]) for a, b in zip(leg, leg[1:], strict=False)] for leg in legs]
    lengths = 0.9995 * np.array(rested).sum(1)
    heads[..., 2] -= sinking(heads[:, hips], np.stack(goals, 1), lengths, times)[:, None]
    first = heads[:, hips[0]].copy()
    for leg, goal in zip(legs, goals, strict=True):
        reach(world, heads, leg, goal)
    heads[:] = _positions(rig, world)
    heads += (first - heads[:, hips[0]])[:, None]


def body_feet(body: Body, betas: NDArray[np.float64]) -> dict[str, FootRest]:
    """The rested body's feet by side; the heel is the rear end of what the foot, without its toes, stands on."""
    v, J = body.rest_vertices(betas) @ R_WORLD_MODEL.T, body.rest_joints(betas) @ R_WORLD_MODEL.T
    strongest = body.skin_joints[np.arange(len(v)), body.skin_weights.argmax(1)]
    low = float(v[:, 2].min())
    out = {}
    for side in ("left", "right"):
        part = body.joint_names.index(f"{side}_ankle")
        ankle, ball = J[part], J[body.joint_names.index(f"{side}_foot")]
        sole = v[(strongest == part) & (v[:, 2] < low + _SOLE_M)]
        heel = sole[sole[:, 1] > sole[:, 1].max() - _HEEL_M].mean(axis=0) if len(sole) else ankle
        out[side] = FootRest(np.array([*heel[:2], low]) - ankle, ball - ankle, float(ankle[2]) - low)
    return out


def _rig_foot(
    rig: Skeleton, AF: NDArray[np.float64], ankle: int, toe: int | None, source: FootRest, scale: float
) -> FootRest:
    """The rig's foot; where no bone tells its ball, it is as long as the body's."""
    height = float(rig.heads[ankle, 2]) - rig.floor
    ball = AF @ ((rig.heads[toe] if toe is not None else rig.tails[ankle]) - rig.heads[ankle])
    length = float(np.linalg.norm(source.ball[:2]))
    share = float(np.linalg.norm(ball[:2])) / length
    if not 0.3 * scale < share < 3 * scale or ball @ source.ball < 0:
        share, ball = scale, np.array([*(scale * source.ball[:2]), -0.8 * height])
    heel = np.array([*(share * source.heel[:2]), -height])  # no bone tells it: as far behind as the body's
    return FootRest(heel, ball, height)


def basis(rig: Skeleton, world: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T, B, 3, 3) rotations that the bones' channels hold: ``B = (R_parent R_parent0ᵀ R_b0)ᵀ R_b``."""
    out = np.empty_like(world)
    for b, parent in enumerate(rig.parents):
        if parent < 0:
            out[:, b] = rig.rotations[b].T @ world[:, b]
        else:
            local = rig.rotations[parent].T @ rig.rotations[b]
            out[:, b] = np.swapaxes(world[:, parent] @ local, 1, 2) @ world[:, b]
    return out


def _positions(rig: Skeleton, world: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T, B, 3) heads where nothing has been moved."""
    heads = np.empty((*world.shape[:2], 3))
    for b, carrier in enumerate(rig.carriers):
        if carrier < 0:
            heads[:, b] = rig.heads[b]
        else:
            offset = rig.rotations[carrier].T @ (rig.heads[b] - rig.heads[carrier])
            heads[:, b] = heads[:, carrier] + world[:, carrier] @ offset
    return heads


def _facing(rig: Skeleton, row: dict[str, int]) -> NDArray[np.float64]:
    """(3, 3) turn about the upright axis after which the rig's left is the body's, +x."""
    left = rig.heads[row["left_hip"]] - rig.heads[row["right_hip"]]
    return exp(np.array([0.0, 0.0, -np.arctan2(left[1], left[0])]))


def _rest_alignment(
    rig: Skeleton, part_of: list[str], row: dict[str, int], rest: NDArray[np.float64], index: dict[str, int], F: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(B, 3, 3) A_b."""
    A = np.tile(np.eye(3), (len(part_of), 1, 1))
    for b, part in enumerate(part_of):
        side, _, kind = part.partition("_")
        parent = int(rig.carriers[b])
        if kind in ("ankle", "foot"):
            end = row.get(f"{side}_foot") if kind == "ankle" else None
            along = F @ ((rig.heads[end] if end is not None else rig.tails[b]) - rig.heads[b])
            ankle, foot = rest[index[f"{side}_ankle"]], rest[index[f"{side}_foot"]]
            flat, wanted = along * [1, 1, 0], (foot - ankle) * [1, 1, 0]
            if np.linalg.norm(flat) > 0.3 * np.linalg.norm(along):
                angle = np.arctan2(wanted[1], wanted[0]) - np.arctan2(flat[1], flat[0])
                A[b] = exp(UP * ((angle + np.pi) % (2 * np.pi) - np.pi))
        elif kind in _NEXT:
            A[b] = before = A[parent] if parent >= 0 and part_of[parent].partition("_")[2] in _NEXT else np.eye(3)
            end = row.get(f"{side}_{_NEXT[kind]}")
            along = (rig.heads[end] if end is not None else rig.tails[b]) - rig.heads[b]
            # Zero for last phalanges, whose ends no joint tells: they bend on the one before as the rig was built.
            wanted = rest[index.get(f"{side}_{_NEXT[kind]}", index[part])] - rest[index[part]]
            if np.linalg.norm(along) > 1e-9 and np.linalg.norm(wanted) > 1e-9:
                A[b] = shortest_turn(before @ F @ along, wanted) @ before
            if kind == "wrist":
                palm = _palm_alignment(rig.heads @ F.T, row, rest, index, side)
                if palm is not None and (np.trace(palm @ A[b].T) - 1) / 2 > np.cos(_MOST_TURN):
                    A[b] = palm
    return A


def _palm_alignment(
    heads: NDArray[np.float64], row: dict[str, int], rest: NDArray[np.float64], index: dict[str, int], side: str
) -> NDArray[np.float64] | None:
    """(3, 3) the turn of the rig's palm onto the body's, by wrist and knuckles; None where one has no fingers."""
    parts = [f"{side}_{part}" for part in ("wrist", "index1", "pinky1")]
    if not all(part in row and part in index for part in parts):
        return None
    palms = []
    for points, rows in ((heads, row), (rest, index)):
        wrist, first, last = (points[rows[part]] for part in parts)
        across, along = first - last, (first + last) / 2 - wrist
        normal = np.cross(along, across)
        if np.linalg.norm(normal) < 1e-9:
            return None
        axes = np.stack([along, np.cross(normal, along), normal], axis=1)
        palms.append(axes / np.linalg.norm(axes, axis=0))
    return palms[1] @ palms[0].T


def _turns(D: NDArray[np.float64], rig: Skeleton, part_of: list[str], index: dict[str, int]) -> NDArray[np.float64]:
    """(T, B, 3, 3) D of each bone; spine and neck are spread over the bones that the rig has for them."""
    out = np.empty((len(D), len(part_of), 3, 3))
    for b, part in enumerate(part_of):
        out[:, b] = D[:, index[part]]
    for chain, parts in ((("pelvis", *SPINE), SPINE), (("spine3", "neck"), ("neck",))):
        bones = [b for b, part in enumerate(part_of) if part in parts]
        for k, b in enumerate(bones):
            place = (len(chain) - 1) * (k + 1) / len(bones)
            low = min(int(place), len(chain) - 2)
            first, second = D[:, index[chain[low]]], D[:, index[chain[low + 1]]]
            share = place - low
            out[:, b] = second if share == 1 else interpolate_rotations(first, second, share)
    return out


def _sole_height(body: Body, betas: NDArray[np.float64]) -> float:
    """Height of the rested body's lowest point, world axes."""
    return float((body.rest_vertices(betas) @ R_WORLD_MODEL.T)[:, 2].min())
