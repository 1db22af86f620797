# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs without Blender: that of the body itself, in other proportions, headings and rest poses."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.scope_addon.retarget.bone_map import PARTS, BoneMap
from scope.scope_addon.retarget.rest_pose import Skeleton
from scope.solver.rotations import exp, shortest_turn

from ..edit.walking import BETAS, BODY, NAMES

MAPPED = [name for name in NAMES if name in PARTS]
VERTICAL = np.array([0.0, 0.0, 1.0])


def body_rig(
    scale: float = 1.0, heading: float = 0.0, arms_down: float = 0.0, seed: int = 0
) -> Skeleton:
    """Return a rig with the body's joints at rest.

    :param scale: of its size.
    :param heading: by which it is turned about the vertical, radians.
    :param arms_down: by which its arms are lowered from the T-pose, radians.
    :param seed: of its bones' axes, which are at random.
    """
    index = [NAMES.index(name) for name in MAPPED]
    parents = np.array([_mapped_parent(i) for i in index])
    heads = scale * (BODY.rest_joints(BETAS) @ R_WORLD_MODEL.T)[index]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder = heads[MAPPED.index(f"{side}_shoulder")].copy()
        lowered = exp(np.array([0.0, sign * arms_down, 0.0]))
        for part in ("elbow", "wrist"):
            b = MAPPED.index(f"{side}_{part}")
            heads[b] = shoulder + lowered @ (heads[b] - shoulder)
    turned = exp(heading * VERTICAL)
    heads = heads @ turned.T
    vertices = BODY.rest_vertices(BETAS) @ R_WORLD_MODEL.T
    rng = np.random.default_rng(seed)
    tails = heads + 0.05 * scale * rng.normal(size=heads.shape)
    rotations = exp(rng.normal(size=(len(MAPPED), 3)))
    return Skeleton(
        list(MAPPED),
        parents,
        parents,
        heads,
        tails,
        rotations,
        floor=scale * float(vertices[:, 2].min()),
    )


def same_names() -> BoneMap:
    return BoneMap({name: name for name in MAPPED})


def _mapped_parent(joint: int) -> int:
    parent = int(BODY.parents[joint])
    while parent >= 0 and NAMES[parent] not in MAPPED:
        parent = int(BODY.parents[parent])
    return MAPPED.index(NAMES[parent]) if parent >= 0 else -1


def direction(points: np.ndarray, first: str, second: str, names: list[str]) -> np.ndarray:
    """Unit vectors (T, 3) from one joint to another of points (T, n, 3)."""
    along = points[:, names.index(second)] - points[:, names.index(first)]
    return along / np.linalg.norm(along, axis=-1, keepdims=True)


def turn_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between vectors (T, 3), radians."""
    turns = shortest_turn(a, b)
    return np.arccos(np.clip((np.trace(turns, axis1=-2, axis2=-1) - 1) / 2, -1, 1))
