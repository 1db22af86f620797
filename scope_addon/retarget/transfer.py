# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations and place of another skeleton that moves as the body does.

With D_i(t) the turn of body part i away from its T-pose in the world, R_b the rest orientation of bone b, F the turn
about the upright axis that lets the rig face as the body does, and A_b the smallest turn, after its parent's, that lays
the rested limb along the body's own,

    R_world_bone(t) = D_i(t) A_b F R_b.

So a limb's direction is the body's whatever pose the rig rests in, and its twist is the one it rests with. Trunk and
head keep the posture in which the rig was built (A_b = I); feet turn about the upright axis alone, so soles stay flat.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.body import Body
from ...solver.frames import R_WORLD_MODEL
from ...solver.rotations import exp, log
from ..edit.clip import Clip
from .bone_map import SPINE, BoneMap
from .legs import reach

UP = np.array([0.0, 0.0, 1.0])
_NEXT = {"hip": "knee", "knee": "ankle", "shoulder": "elbow", "elbow": "wrist", "wrist": "hand"}


@dataclass(frozen=True)
class Skeleton:
    """The mapped bones of a rig in its rest pose, in the world (z up, metres), parents before children.

    ``parents`` are the mapped bones that each one follows rigidly, -1 where it follows none.
    """

    names: list[str]
    parents: np.ndarray  # (B,)
    heads: np.ndarray  # (B, 3)
    tails: np.ndarray  # (B, 3)
    rotations: np.ndarray  # (B, 3, 3) bone to world
    floor: float = 0.0  # height on which the rig rests


@dataclass(frozen=True)
class Pose:
    """A skeleton's motion in the world: rotations (T, B, 3, 3), heads (T, B, 3) metres."""

    rotations: np.ndarray
    heads: np.ndarray


def shortest_turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(3, 3) the smallest rotation that takes the direction of a to that of b."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis = np.cross(a, b)
    sine, cosine = float(np.linalg.norm(axis)), float(a @ b)
    if sine < 1e-9:
        if cosine > 0:
            return np.eye(3)
        axis = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        sine = float(np.linalg.norm(axis))
        return exp(axis / sine * np.pi)
    return exp(axis / sine * np.arctan2(sine, cosine))


def transfer(
    clip: Clip, body: Body, betas: np.ndarray, rig: Skeleton, bone_map: BoneMap, *, feet: bool = True
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

    def leg_length(points: np.ndarray, rows: dict[str, int], side: str) -> float:
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
        for side in sides:
            if f"{side}_ankle" in row:
                ankle, source = row[f"{side}_ankle"], index[f"{side}_ankle"]
                goal = scale * joints[:, source]
                goal[:, 2] += (rig.heads[ankle, 2] - rig.floor) - scale * (rest[source, 2] - sole)
                # Reach, then let what hangs on the leg follow; the foot keeps its turn.
                reach(world, heads, (row[f"{side}_hip"], row[f"{side}_knee"], ankle), goal)
        heads = _positions(rig, world) + (heads[:, hips[:1]] - _positions(rig, world)[:, hips[:1]])
    return Pose(world, heads)


def basis(rig: Skeleton, world: np.ndarray) -> np.ndarray:
    """(T, B, 3, 3) rotations that the bones' channels hold: ``B = (R_parent R_parent0ᵀ R_b0)ᵀ R_b``."""
    out = np.empty_like(world)
    for b, parent in enumerate(rig.parents):
        if parent < 0:
            out[:, b] = rig.rotations[b].T @ world[:, b]
        else:
            local = rig.rotations[parent].T @ rig.rotations[b]
            out[:, b] = np.swapaxes(world[:, parent] @ local, 1, 2) @ world[:, b]
    return out


def _positions(rig: Skeleton, world: np.ndarray) -> np.ndarray:
    """(T, B, 3) heads where nothing has been moved."""
    heads = np.empty((*world.shape[:2], 3))
    for b, parent in enumerate(rig.parents):
        if parent < 0:
            heads[:, b] = rig.heads[b]
        else:
            offset = rig.rotations[parent].T @ (rig.heads[b] - rig.heads[parent])
            heads[:, b] = heads[:, parent] + world[:, parent] @ offset
    return heads


def _facing(rig: Skeleton, row: dict[str, int]) -> np.ndarray:
    """(3, 3) turn about the upright axis after which the rig's left is the body's, +x."""
    left = rig.heads[row["left_hip"]] - rig.heads[row["right_hip"]]
    return exp(np.array([0.0, 0.0, -np.arctan2(left[1], left[0])]))


def _rest_alignment(
    rig: Skeleton, part_of: list[str], row: dict[str, int], rest: np.ndarray, index: dict[str, int], F: np.ndarray
) -> np.ndarray:
    """(B, 3, 3) A_b."""
    A = np.tile(np.eye(3), (len(part_of), 1, 1))
    for b, part in enumerate(part_of):
        side, _, kind = part.partition("_")
        parent = int(rig.parents[b])
        if kind in ("ankle", "foot"):
            end = row.get(f"{side}_foot") if kind == "ankle" else None
            along = F @ ((rig.heads[end] if end is not None else rig.tails[b]) - rig.heads[b])
            ankle, foot = rest[index[f"{side}_ankle"]], rest[index[f"{side}_foot"]]
            flat, wanted = along * [1, 1, 0], (foot - ankle) * [1, 1, 0]
            if np.linalg.norm(flat) > 0.3 * np.linalg.norm(along):
                angle = np.arctan2(wanted[1], wanted[0]) - np.arctan2(flat[1], flat[0])
                A[b] = exp(UP * ((angle + np.pi) % (2 * np.pi) - np.pi))
        elif kind in _NEXT:
            end = row.get(f"{side}_{_NEXT[kind]}")
            along = (rig.heads[end] if end is not None else rig.tails[b]) - rig.heads[b]
            wanted = rest[index.get(f"{side}_{_NEXT[kind]}", index[part])] - rest[index[part]]
            before = A[parent] if parent >= 0 and part_of[parent].partition("_")[2] in _NEXT else np.eye(3)
            if np.linalg.norm(along) > 1e-9 and np.linalg.norm(wanted) > 1e-9:
                A[b] = shortest_turn(before @ F @ along, wanted) @ before
    return A


def _turns(D: np.ndarray, rig: Skeleton, part_of: list[str], index: dict[str, int]) -> np.ndarray:
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
            turned = second if share == 1 else first @ exp(share * log(np.swapaxes(first, 1, 2) @ second))
            out[:, b] = turned
    return out


def _sole_height(body: Body, betas: np.ndarray) -> float:
    """Height of the rested body's lowest point, world axes."""
    return float((body.rest_vertices(betas) @ R_WORLD_MODEL.T)[:, 2].min())
