# SPDX-License-Identifier: GPL-3.0-or-later
"""The person whose skeleton a BVH file moves, on one of our bodies.

Which joint is which body part is guessed as for rigs. With R_0 the joints' rotations in a pose in
which the person stands upright, and A the alignment of limbs of `retarget.transfer`, which takes
their directions in that pose to those of the body at rest, the parts of the body are rotated by

    D_i(t) = R_b(t) R_bᵀ_0 (A_b F)ᵀ,

so that limbs have the file's directions whatever its rest pose. Distances are multiplied by the
ratio of the legs' lengths, so the unit of the file has no effect.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...solver.body import Body
from ...solver.rotations import log, shortest_turn
from ..arrays import Float64Array, unit_vectors
from ..errors import MotionFileError
from ..kinematics.axes import R_WORLD_MODEL, UP, rotated, transposed
from ..kinematics.frame_blocks import by_blocks
from ..kinematics.smoothing import interpolate_rotations
from ..notices import Notice, and_more, notice
from ..untrusted.bvh_file import BvhMotion
from .bone_map import REQUIRED, SIDED_PARTS, SPINE
from .fingers import bone_ends
from .guess import IMPOSSIBLE, by_name, guess
from .rest_pose import RestPose, Skeleton
from .smpl_motion import FARTHEST_M, MAX_PEOPLE
from .transfer import leg_length, rest_alignment

# The axes along which people may stand in a file, the usual ones first.
_UP_AXES = {
    "y": np.array([0.0, 1.0, 0.0]), "z": UP, "minus y": np.array([0.0, -1.0, 0.0]),
    "minus z": -UP, "x": np.array([1.0, 0.0, 0.0]), "minus x": np.array([-1.0, 0.0, 0.0]),
}  # fmt: skip
_NAMED_UP = {"y": "y", "z": "z", "camera": "minus y"}
# Cosine with the vertical that the trunk and both legs have in a pose of standing.
_STANDING = 0.7
# Mean cosine of the trunk with the vertical, above which people stand or sit along it.
_UPRIGHT = 0.5
_BLOCK_MATRICES = 200_000  # that are computed at a time
_LISTED = 12  # joints in a message


@dataclass(frozen=True)
class Performer:
    """A person of a BVH file: which joints are which parts, and the pose that they are compared
    in.
    """

    file: BvhMotion
    parts: dict[str, str]  # joint -> body part
    R_world_file: Float64Array
    frame: int | None  # in which the person stands upright; None: the pose at rest
    notes: list[Notice]

    def on_body(self, body: Body, path: Path) -> tuple[Float64Array, Float64Array, list[Notice]]:
        """Return the axis-angle vectors (T, K+1, 3) of a body of mean shape, the place of its
        pelvis (T, 3), metres, and what cannot be as in the file. World frame, z up, any floor.

        :param path: names the file in messages.
        :raises MotionFileError: the legs have no length, or the person is too far away.
        """
        betas = np.zeros(body.P)
        rest = body.rest_joints(betas)
        index = {part: joint for joint, part in enumerate(body.joint_names)}
        names = [name for name in self.file.names if self.parts.get(name) in index]
        joints = [self.file.names.index(name) for name in names]
        part_of = [self.parts[name] for name in names]
        row: dict[str, int] = {}
        for place, part in enumerate(part_of):
            row.setdefault(part, place)
        R_first, heads = _pose(self.file, self.frame, self.R_world_file)
        tails = heads + rotated(R_first, self.file.ends)
        whole = RestPose(self.file.names, self.file.parents, heads, tails)
        above = [[k for k in whole.chains[joint][:-1] if k in joints] for joint in joints]
        parents = np.array([joints.index(chain[-1]) if chain else -1 for chain in above], np.intp)
        skeleton = Skeleton(
            names,
            parents,
            parents,
            heads[joints],
            bone_ends(whole, names, self.parts),
            R_first[joints],
        )
        alignment = rest_alignment(skeleton, part_of, row, rest @ R_WORLD_MODEL.T, index)
        # To the file's axes at rest from those of the body's part in its T-pose.
        R_joint_part = transposed(alignment @ R_first[joints])
        file_legs = leg_length(skeleton.heads, row)
        if not file_legs > 0:
            raise MotionFileError(
                f"{path}: the legs of its skeleton have no length; choose another file"
            )
        scale = leg_length(rest, {part: index[part] for part in row}) / file_legs
        hips = [row["left_hip"], row["right_hip"]]
        body_hips = [index["left_hip"], index["right_hip"]]

        def block(values: Float64Array) -> tuple[Float64Array, ...]:
            R_file, points = self.file.posed(values, joints)
            R_world_joint = self.R_world_file @ R_file
            turns = _of_parts(R_world_joint @ R_joint_part, part_of, body)
            R_world_part = turns @ R_WORLD_MODEL
            local = R_world_part.copy()
            R_world_parent = R_world_part[:, body.parents[1:]]
            local[:, 1:] = transposed(R_world_parent) @ R_world_part[:, 1:]
            wanted = scale * points[:, hips].mean(axis=1) @ self.R_world_file.T
            at_origin = body.forward_kinematics(local, np.zeros((len(values), 3)), betas)[1]
            pelvis = at_origin[:, 0] + wanted - at_origin[:, body_hips].mean(axis=1)
            return log(local).astype(np.float32), pelvis

        frames = max(1, _BLOCK_MATRICES // len(self.file.names))
        poses, root = by_blocks(block, self.file.values, frames=frames)
        if np.abs(root).max() > FARTHEST_M:
            raise MotionFileError(
                f"{path}: the person is {np.abs(root).max():.3g} m from the origin; choose another "
                "file"
            )
        notes = [notice("other_skeleton", scale=float(scale))]
        sided = [f"{side}_{part}" for side in ("left", "right") for part in SIDED_PARTS]
        still = [part.replace("_", " ") for part in ("head", *sided) if part not in row]
        if still:
            notes.append(notice("missing_joints", parts=still))
        return poses.astype(float), root, [*self.notes, *notes]


def find_performers(file: BvhMotion, path: Path, up: str) -> list[Performer]:
    """Find the people of a file, of whom each has a root of their own; other roots are left out.

    :param path: names the file in messages.
    :param up: the axis that points up in the file: ``z``, ``y``, ``camera`` (minus y) or ``auto``.
    :raises MotionFileError: nobody's pelvis and legs are found.
    """
    found = []
    for part in file.by_root()[:MAX_PEOPLE]:
        with suppress(MotionFileError):
            found.append(_performer(part, path, up))
    return found or [_performer(file, path, up)]


def _performer(file: BvhMotion, path: Path, up: str) -> Performer:
    """Find which joints of a file are which body parts, which axis points up, and a pose in which
    the person stands: the pose at rest, or else the frame that comes nearest to it.

    :raises MotionFileError: the pelvis or the legs are not found.
    """
    axes = _UP_AXES if up == "auto" else {_NAMED_UP[up]: _UP_AXES[_NAMED_UP[up]]}
    named = by_name(RestPose(file.names, file.parents, file.at_rest()))
    for name, axis in axes.items():
        R_world_file = shortest_turn(axis, UP)
        _, heads = _pose(file, None, R_world_file)
        parts, odd = _guess(RestPose(file.names, file.parents, heads))
        is_sound = not _missing(parts) and not odd
        if not _missing(named):
            # Whatever lies at rest may look like a person from some side.
            is_sound = is_sound and _needed(parts) == _needed(named)
        if not is_sound or (_limbs(file, parts, heads[None]) @ UP).min() < _STANDING:
            continue
        trunk = _limbs(file, parts)[:, 0].mean(axis=0)
        is_sure = up != "auto" or trunk @ axis > _UPRIGHT
        notes = [] if is_sure else [notice("unsure_up", axis=name)]
        return Performer(file, parts, R_world_file, None, notes)
    return _without_rest_pose(file, path, named, axes)


def _without_rest_pose(
    file: BvhMotion, path: Path, parts: dict[str, str], axes: dict[str, Float64Array]
) -> Performer:
    """Find a person whose rest pose is none of standing: by the names of the joints, and by the
    frame in which trunk and legs are most upright.

    :param parts: by the names.
    :param axes: of which one points up.
    """
    missing = _missing(parts)
    if missing:
        listed = and_more(file.names[:_LISTED], len(file.names))
        raise MotionFileError(
            f"{path}: none of its joints was recognized as {missing[0].replace('_', ' ')}; they "
            f"are {listed}; name them as Mixamo or SMPL do"
        )
    limbs = _limbs(file, parts)
    cosines = {name: (limbs @ axis).min(axis=1) for name, axis in axes.items()}
    name = max(cosines, key=lambda each: float(cosines[each].mean()))
    frame = int(cosines[name].argmax())
    R_world_file = shortest_turn(axes[name], UP)
    _, heads = _pose(file, frame, R_world_file)
    guessed, odd = _guess(RestPose(file.names, file.parents, heads))
    notes = [notice("no_rest_pose", frame=frame + 1)]
    if len(axes) > 1 and (limbs[:, 0] @ axes[name]).mean() < _UPRIGHT:
        notes.append(notice("unsure_up", axis=name))
    if odd:
        notes.append(notice("odd_joints", joints=odd))
    if _needed(guessed) == _needed(parts):
        parts = guessed
    return Performer(file, parts, R_world_file, frame, notes)


def _guess(rest: RestPose) -> tuple[dict[str, str], list[str]]:
    """Return the body part of each joint, and the joints that cannot be what they seem to be."""
    bone_map = guess(rest)
    odd = [joint for joint, sure in bone_map.confidence.items() if sure <= IMPOSSIBLE]
    return bone_map.parts, odd


def _missing(parts: dict[str, str]) -> list[str]:
    """Return what is needed and has no joint."""
    return [part for part in REQUIRED if part not in parts.values()]


def _needed(parts: dict[str, str]) -> set[str]:
    """Return the joints of what is needed, of either side."""
    return {joint for joint, part in parts.items() if part in REQUIRED}


def _pose(
    file: BvhMotion, frame: int | None, R_world_file: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return all joints' rotations (N, 3, 3) and positions (N, 3) in the world, at rest or in a
    frame.
    """
    if frame is None:
        rotations = np.tile(R_world_file, (len(file.names), 1, 1))
        return rotations, file.at_rest() @ R_world_file.T
    R_file, points = file.posed(file.values[[frame]], list(range(len(file.names))))
    return R_world_file @ R_file[0], points[0] @ R_world_file.T


def _limbs(
    file: BvhMotion, parts: dict[str, str], points: Float64Array | None = None
) -> Float64Array:
    """Return unit vectors (T, 3, 3) up the trunk, the left leg and the right leg, in the file's
    axes.

    :param points: (T, N, 3) all joints; by default, those of the motion.
    """
    joint_of: dict[str, int] = {}
    for joint, name in enumerate(file.names):
        if name in parts:
            joint_of.setdefault(parts[name], joint)
    tops = ("head", "neck", "left_shoulder", *reversed(SPINE), "left_hip")
    top = next(joint_of[part] for part in tops if part in joint_of)
    hips = [joint_of[f"{side}_hip"] for side in ("left", "right")]
    feet = [joint_of.get(f"{side}_ankle", joint_of[f"{side}_knee"]) for side in ("left", "right")]
    joints = [top, *hips, *feet]
    if points is None:
        frames = max(1, _BLOCK_MATRICES // len(file.names))
        (chosen,) = by_blocks(
            lambda values: (file.posed(values, joints)[1],), file.values, frames=frames
        )
    else:
        chosen = points[:, joints]
    trunk = chosen[:, :1] - chosen[:, 1:3].mean(axis=1, keepdims=True)
    along = np.concatenate([trunk, chosen[:, 1:3] - chosen[:, 3:]], axis=1)
    return unit_vectors(along)


def _of_parts(turns: Float64Array, part_of: list[str], body: Body) -> Float64Array:
    """Return D (T, K+1, 3, 3) of the body's parts from those of the file's joints (T, B, 3, 3).

    The spine's joints are spread over the file's; parts without a joint follow those above.
    """
    found = {part: turns[:, joint] for joint, part in enumerate(part_of)}
    spine = [turns[:, joint] for joint, part in enumerate(part_of) if part in SPINE]
    chain = [found["pelvis"], *spine]
    for k, part in enumerate(SPINE, 1):
        place = len(spine) * k / len(SPINE)
        low = int(place)
        high = min(low + 1, len(spine))
        found[part] = interpolate_rotations(chain[low], chain[high], place - low)
    if "neck" not in found and "head" in found:
        found["neck"] = interpolate_rotations(found["spine3"], found["head"], 0.5)
    out = np.empty((len(turns), len(body.joint_names), 3, 3))
    for joint, (part, parent) in enumerate(zip(body.joint_names, body.parents, strict=True)):
        out[:, joint] = found[part] if part in found else out[:, parent]
    return out
