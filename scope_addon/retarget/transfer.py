# SPDX-License-Identifier: GPL-3.0-or-later
"""Transferring the body's motion to another skeleton.

With D_i(t) the rotation of body part i from its T-pose in the world, R_b the rest orientation of
bone b, F the rotation about the vertical that gives the rig the heading of the body, and A_b the
smallest rotation, after that of its parent, that aligns the rig's limb at rest with the body's,

    R_world_bone(t) = D_i(t) A_b F R_b.

A limb therefore has the direction of the body's whatever the rest pose of the rig, and the twist of
its own rest pose. Trunk and head keep the posture in which the rig was built (A_b = I). Feet are
only rotated about the vertical, so soles stay flat. Where fingers are captured and the rig has
them, the palms are aligned too, so that fingers bend about the right axes.
"""

from __future__ import annotations

import numpy as np

from ...solver.body import Body
from ...solver.names import FINGERS
from ...solver.rotations import exp, shortest_turn
from ..arrays import BoolArray, Float64Array, FloatArray, IndexArray
from ..edit.clip import Clip
from ..kinematics.axes import R_WORLD_MODEL, UP
from ..kinematics.smoothing import interpolate_rotations
from .bone_map import SPINE, BoneMap
from .foot_placement import legs_at_rest, place_feet
from .rest_pose import Pose, Skeleton, head_positions

_NEXT = {"hip": "knee", "knee": "ankle", "shoulder": "elbow", "elbow": "wrist", "wrist": "hand"}
# The fourth does not exist in any body: the last phalanx has no end joint.
_NEXT |= {f"{finger}{k}": f"{finger}{k + 1}" for finger in FINGERS for k in (1, 2, 3)}
# A larger angle between two palms at rest means that fingers were confused.
_MAX_PALM_TURN = np.radians(100)


def leg_ratio(body: Body, betas: FloatArray, rig: Skeleton, bone_map: BoneMap) -> float:
    """Return the rig's leg length divided by that of the body with the shape ``betas`` (P,)."""
    rows = rig.rows(bone_map)
    parts = {part: body.joint_names.index(part) for part in rows}
    return leg_length(rig.heads, rows) / leg_length(body.rest_joints(betas), parts)


class Transfer:
    """The transfer from one body to one rig, with everything that does not depend on the motion
    computed once.
    """

    def __init__(
        self,
        body: Body,
        betas: FloatArray,
        rig: Skeleton,
        bone_map: BoneMap,
        *,
        feet: bool = True,
        travel: float | None = None,
    ) -> None:
        """Compare both at rest.

        :param betas: (P,) shape coefficients of the body.
        :param feet: place the feet where the body's are, scaled; bends the legs a little.
        :param travel: scale of positions on the floor; None: the ratio of leg lengths, by which
            heights are scaled in any case. Rigs that share it keep the distances between the people
            in proportion.
        """
        self._body = body
        self._betas = betas
        self._rig = rig
        index = {part: k for k, part in enumerate(body.joint_names)}
        rest = body.rest_joints(betas) @ R_WORLD_MODEL.T
        row = rig.rows(bone_map)
        part_of = [bone_map.parts[name] for name in rig.names]
        self._first, self._second, self._shares = _between(part_of, index)
        F = _heading_alignment(rig, row)
        self._facing = float(np.arctan2(F[1, 0], F[0, 0]))
        alignment = rest_alignment(rig, part_of, row, rest, index)
        self._rested = alignment @ rig.rotations
        legs = leg_ratio(body, betas, rig, bone_map)
        self._scales = np.array([legs if travel is None else travel] * 2 + [legs])
        self._hips = [row["left_hip"], row["right_hip"]]
        self._source_hips = [index["left_hip"], index["right_hip"]]
        # Both stand on their floors in the body's T-pose: heights are measured from there.
        self._lift = np.zeros(3)
        vertices = body.rest_vertices(betas) @ R_WORLD_MODEL.T
        rested = rest[self._source_hips, 2].mean() - vertices[:, 2].min()
        self._lift[2] = self._height_of_hips(row) - legs * rested
        self._legs = (
            legs_at_rest(rig, row, alignment, body, (vertices, rest), self._scales)
            if feet
            else None
        )

    def pose(self, clip: Clip, one_floor: BoolArray | bool = True) -> Pose:
        """Compute the rig's motion.

        :param one_floor: where feet that are placed are kept above the floor, (T,) or in all of the
            frames; see `frames_on_one_floor`.
        """
        rig = self._rig
        R, joints = clip.parts(self._body, self._betas)
        turns = self._turns(R @ R_WORLD_MODEL.T)
        world = turns @ self._rested
        heads = head_positions(rig, world)
        source_hips = joints[:, self._source_hips].mean(axis=1)
        heads += (self._scales * source_hips + self._lift - heads[:, self._hips].mean(axis=1))[
            :, None
        ]
        pose = Pose(world, heads, self._facing)
        if self._legs is not None:
            held = np.broadcast_to(one_floor, len(clip))
            place_feet(rig, self._legs, turns, pose, joints, clip.times, held)
        return pose

    def _height_of_hips(self, row: dict[str, int]) -> float:
        """Return how high the rig's hips are above its floor, metres, where its legs have the
        directions of the body's at rest; its own may be bent at rest.

        :param row: the rig's bone of each body part.
        """
        part = "ankle" if "left_ankle" in row and "right_ankle" in row else "knee"
        ends = [row[f"left_{part}"], row[f"right_{part}"]]
        heads = head_positions(self._rig, self._rested[None])[0, :, 2]
        standing = heads[self._hips] - heads[ends] + self._rig.heads[ends, 2]
        return float(standing.mean()) - self._rig.floor

    def _turns(self, D: Float64Array) -> Float64Array:
        """Return D of each bone (T, B, 3, 3) from D of each joint; spine and neck are distributed
        over their bones.
        """
        out: Float64Array = D[:, self._first]
        bones = np.flatnonzero(self._shares)
        if len(bones):
            out[:, bones] = interpolate_rotations(
                out[:, bones], D[:, self._second[bones]], self._shares[bones]
            )
        return out


def leg_length(points: Float64Array, rows: dict[str, int]) -> float:
    """Return the length of both legs, metres; without an ankle, the shin is taken to be as long as
    the thigh.
    """
    total = 0.0
    for side in ("left", "right"):
        hip = points[rows[f"{side}_hip"]]
        knee = points[rows[f"{side}_knee"]]
        ankle = rows.get(f"{side}_ankle")
        end = points[ankle] if ankle is not None else knee + (knee - hip)
        total += float(np.linalg.norm(knee - hip) + np.linalg.norm(end - knee))
    return total


def _between(
    part_of: list[str], index: dict[str, int]
) -> tuple[IndexArray, IndexArray, Float64Array]:
    """Return the two joints (B,) that each bone turns between, and its share (B,) of the way to the
    second, below 1.

    Bones turn with the joint of their own part, except those of spine and neck.
    """
    first = np.array([index[part] for part in part_of])
    second = first.copy()
    shares = np.zeros(len(first))
    for chain, parts in ((("pelvis", *SPINE), SPINE), (("spine3", "neck"), ("neck",))):
        bones = [b for b, part in enumerate(part_of) if part in parts]
        for k, b in enumerate(bones):
            place = (len(chain) - 1) * (k + 1) / len(bones)
            low = int(place)
            last = len(chain) - 1
            first[b] = index[chain[low]]
            second[b] = index[chain[min(low + 1, last)]]
            shares[b] = place - low
    return first, second, shares


def _heading_alignment(rig: Skeleton, row: dict[str, int]) -> Float64Array:
    """Return F (3, 3), the rotation about the vertical that turns the rig's left to the body's, +x.

    :param row: the rig's bone of each body part.
    """
    left = rig.heads[row["left_hip"]] - rig.heads[row["right_hip"]]
    return exp(np.array([0.0, 0.0, -np.arctan2(left[1], left[0])]))


def rest_alignment(
    rig: Skeleton,
    part_of: list[str],
    row: dict[str, int],
    rest: Float64Array,
    index: dict[str, int],
) -> Float64Array:
    """Return A_b F of every bone.

    :param part_of: the body part of each bone.
    :param row: the rig's bone of each body part.
    :param rest: (K+1, 3) the body's rest joints, metres, world axes.
    :param index: the joint of each body part.
    :return: (B, 3, 3) rotations.
    """
    F = _heading_alignment(rig, row)
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
    return A @ F


def _heading_turn(along: Float64Array, wanted: Float64Array) -> Float64Array:
    """Return the turn (3, 3) about the vertical from one direction (3,) to another; none of a steep
    one.
    """
    flat = along * [1, 1, 0]
    goal = wanted * [1, 1, 0]
    if np.linalg.norm(flat) <= 0.3 * np.linalg.norm(along):
        return np.eye(3)
    angle = np.arctan2(goal[1], goal[0]) - np.arctan2(flat[1], flat[0])
    return exp(UP * ((angle + np.pi) % (2 * np.pi) - np.pi))


def _palm_alignment(
    heads: Float64Array,
    row: dict[str, int],
    rest: Float64Array,
    index: dict[str, int],
    side: str,
) -> Float64Array | None:
    """Return the rotation (3, 3) of the rig's palm to the body's, from wrist and the outermost
    knuckles that both have; None without two fingers beside the thumb.
    """
    parts = [f"{side}_{part}" for part in ("wrist", *(f"{finger}1" for finger in FINGERS[1:]))]
    parts = [part for part in parts if part in row and part in index]
    if len(parts) < 3 or not parts[0].endswith("wrist"):
        return None
    parts = [parts[0], parts[1], parts[-1]]
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
    return palms[1] @ palms[0].T
