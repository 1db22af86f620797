# SPDX-License-Identifier: GPL-3.0-or-later
"""The rotations that align a rig's rest pose with the body's T-pose: F for the heading, A_b for
each bone.

See ``transfer.py`` for their use.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...solver.rotations import exp, shortest_turn
from ..kinematics.axes import UP
from .bone_map import FINGERS
from .skeleton import Skeleton

_NEXT = {"hip": "knee", "knee": "ankle", "shoulder": "elbow", "elbow": "wrist", "wrist": "hand"}
# The fourth does not exist in any body: the last phalanx has no end joint.
_NEXT |= {f"{finger}{k}": f"{finger}{k + 1}" for finger in FINGERS for k in (1, 2, 3)}
# A larger angle between two palms at rest means that fingers were confused.
_MAX_PALM_TURN = np.radians(100)


def heading_alignment(rig: Skeleton, row: dict[str, int]) -> NDArray[np.float64]:
    """Return F (3, 3), the rotation about the vertical that turns the rig's left to the body's, +x.

    :param row: the rig's bone of each body part.
    """
    left = rig.heads[row["left_hip"]] - rig.heads[row["right_hip"]]
    return exp(np.array([0.0, 0.0, -np.arctan2(left[1], left[0])]))


def rest_alignment(
    rig: Skeleton,
    part_of: list[str],
    row: dict[str, int],
    rest: NDArray[np.float64],
    index: dict[str, int],
    F: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return A_b of every bone.

    :param part_of: the body part of each bone.
    :param row: the rig's bone of each body part.
    :param rest: (K+1, 3) the body's rest joints, metres, world axes.
    :param index: the joint of each body part.
    :param F: (3, 3) the heading alignment.
    :return: (B, 3, 3) rotations.
    """
    A = np.tile(np.eye(3), (len(part_of), 1, 1))
    for b, part in enumerate(part_of):
        side, _, kind = part.partition("_")
        if kind == "foot" and f"{side}_ankle" in row:
            A[b] = A[row[f"{side}_ankle"]]  # Toes go on where the foot points.
        elif kind in ("ankle", "foot"):
            toes = row.get(f"{side}_foot") if kind == "ankle" else None
            along = F @ ((rig.heads[toes] if toes is not None else rig.ends[b]) - rig.heads[b])
            A[b] = _heading_turn(along, rest[index[f"{side}_foot"]] - rest[index[f"{side}_ankle"]])
        elif kind in _NEXT:
            parent = int(rig.carriers[b])
            before = (
                A[parent]
                if parent >= 0 and part_of[parent].partition("_")[2] in _NEXT
                else np.eye(3)
            )
            end = row.get(f"{side}_{_NEXT[kind]}")
            along = (rig.heads[end] if end is not None else rig.ends[b]) - rig.heads[b]
            # Zero for the last phalanges, which have no end joint: they keep the rig's angle to the
            # one before.
            wanted = rest[index.get(f"{side}_{_NEXT[kind]}", index[part])] - rest[index[part]]
            can_turn = np.linalg.norm(along) > 1e-9 and np.linalg.norm(wanted) > 1e-9
            A[b] = shortest_turn(before @ F @ along, wanted) @ before if can_turn else before
            palm = (
                _palm_alignment(rig.heads @ F.T, row, rest, index, side)
                if kind == "wrist"
                else None
            )
            if palm is not None and (np.trace(palm @ A[b].T) - 1) / 2 > np.cos(_MAX_PALM_TURN):
                A[b] = palm
    return A


def _heading_turn(along: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the turn (3, 3) about the vertical from one direction (3,) to another; none of a steep
    one.
    """
    flat = along * [1, 1, 0]
    goal = wanted * [1, 1, 0]
    if np.linalg.norm(flat) <= 0.3 * np.linalg.norm(along):
        return np.eye(3)
    angle = np.arctan2(goal[1], goal[0]) - np.arctan2(flat[1], flat[0])
    turn: NDArray[np.float64] = exp(UP * ((angle + np.pi) % (2 * np.pi) - np.pi))
    return turn


def _palm_alignment(
    heads: NDArray[np.float64],
    row: dict[str, int],
    rest: NDArray[np.float64],
    index: dict[str, int],
    side: str,
) -> NDArray[np.float64] | None:
    """Return the rotation (3, 3) of the rig's palm to the body's, from wrist and knuckles; None
    without fingers.
    """
    parts = [f"{side}_{part}" for part in ("wrist", "index1", "pinky1")]
    if not all(part in row and part in index for part in parts):
        return None
    palms = []
    for points, rows in ((heads, row), (rest, index)):
        wrist, first, last = (points[rows[part]] for part in parts)
        across = first - last
        along = (first + last) / 2 - wrist
        normal = np.cross(along, across)
        if np.linalg.norm(normal) < 1e-9:
            return None
        axes = np.stack([along, np.cross(normal, along), normal], axis=1)
        palms.append(axes / np.linalg.norm(axes, axis=0))
    alignment: NDArray[np.float64] = palms[1] @ palms[0].T
    return alignment
