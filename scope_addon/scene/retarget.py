# SPDX-License-Identifier: GPL-3.0-or-later
"""A captured motion on the user's own rig, as a new action.

What follows what is tried out on the rig itself: each mapped bone is turned once and the others are looked at. So
constraints, as Rigify's controls have them, need no knowledge of their own, and no frame has to be evaluated.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Quaternion

from ...solver.body import Body
from ...solver.errors import UsageError
from ...solver.rotations import quaternion_from_matrix
from ..retarget.bone_map import PHALANGES, BoneMap
from ..retarget.guess import RestBones, guess
from ..retarget.transfer import Skeleton, basis, transfer
from .actions import Channels, bone_path
from .animation import on_one_hemisphere
from .keys import read_clip
from .root_object import path_clip

# Rigify's switches: limbs by FK, neck and head with the chest.
_SWITCHES = ("IK_FK", "neck_follow", "head_follow")


@dataclass(frozen=True)
class RetargetOptions:
    """What the user may choose."""

    feet: bool = True  # feet stand where the body's do
    in_place: bool = False  # no way over the floor


def guess_bone_map(rig: bpy.types.Object) -> BoneMap:
    """Guess by the rig's names and rest pose."""
    bones = list(rig.data.bones)
    names = [bone.name for bone in bones]
    parents = np.array([names.index(bone.parent.name) if bone.parent else -1 for bone in bones], int)
    heads = np.array([rig.matrix_world @ bone.head_local for bone in bones]).reshape(-1, 3)
    return guess(RestBones(names, parents, heads))


def retarget(
    source: bpy.types.Object,
    body: Body,
    betas: np.ndarray,
    rig: bpy.types.Object,
    bone_map: BoneMap,
    rate: float,
    options: RetargetOptions | None = None,
) -> bpy.types.Action:
    """Key the mapped bones of ``rig`` so that it moves as the captured ``source``; returns the new action.

    The rig's former action stays in the file. Fingers stay as they are where none were captured.

    :raises UsageError: the rig is the source, or has no such bones.
    :raises InputError: the map cannot be used.
    """
    options = options or RetargetOptions()
    bone_map.check()
    if rig == source or rig.type != "ARMATURE":
        raise UsageError("choose another armature than the captured one as the rig that shall move")
    missing = [name for name in bone_map.parts if name not in rig.pose.bones]
    if missing:
        raise UsageError(f"'{rig.name}' has no bone '{missing[0]}'; guess the bones anew or correct the list")
    bone_map = BoneMap({bone: part for bone, part in bone_map.parts.items() if part in body.joint_names})
    clip, frames = read_clip(source, body, rate)
    clip = path_clip(source, clip, frames)
    with _all_or_nothing(rig):
        with _at_rest(rig):
            skeleton = _probe(rig, bone_map.parts)
        pose = transfer(clip, body, betas, skeleton, bone_map, feet=options.feet)
        root = skeleton.names.index(bone_map.bone("pelvis") or "")
        heads = pose.heads[:, root].copy()
        if options.in_place:
            heads[:, :2] = skeleton.heads[root, :2]
        _write(rig, skeleton, basis(skeleton, pose.rotations), root, heads, frames, source.name)
    assert rig.animation_data is not None
    return rig.animation_data.action


@contextmanager
def _all_or_nothing(rig: bpy.types.Object) -> Iterator[None]:
    """What fails leaves the rig's switches and its action as they were, and no action of its own."""
    switches = [(bone, name, bone[name]) for bone in rig.pose.bones for name in _SWITCHES if name in bone]
    had_data = rig.animation_data is not None
    action = rig.animation_data.action if rig.animation_data else None
    slot = getattr(rig.animation_data, "action_slot", None)
    kept = action.use_fake_user if action else False
    known = set(bpy.data.actions)
    try:
        yield
    except BaseException:
        for bone, name, value in switches:
            bone[name] = value
        if not had_data:
            rig.animation_data_clear()
        elif rig.animation_data.action != action:
            rig.animation_data.action = action
            if slot is not None:
                rig.animation_data.action_slot = slot
        if action:
            action.use_fake_user = kept
        bpy.data.batch_remove([new for new in bpy.data.actions if new not in known])
        rig.update_tag()
        raise


def _write(rig, skeleton, rotations, root, heads, frames, name):  # type: ignore[no-untyped-def]
    """A new action with the keys; each bone's in the mode that it has."""
    animation = rig.animation_data or rig.animation_data_create()
    if animation.action is not None:
        animation.action.use_fake_user = True
    action = bpy.data.actions.new(f"{rig.name}_{name}")
    channels = Channels(rig, action)
    for b, bone_name in enumerate(skeleton.names):
        bone = rig.pose.bones[bone_name]
        path, values = _channel(bone.rotation_mode, rotations[:, b])
        channels.write(bone_path(bone_name, path), frames, values, group=bone_name)
    bone = rig.pose.bones[skeleton.names[root]]
    world = np.array(rig.matrix_world, float)[:3, :3]
    moved = (heads - skeleton.heads[root]) @ np.linalg.inv(world).T
    if bone.bone.use_local_location:
        axes = skeleton.rotations[root].T @ (world / np.cbrt(np.linalg.det(world)))
        moved = moved @ axes.T
    channels.write(bone_path(bone.name, "location"), frames, moved, group=bone.name)


def _channel(mode: str, R: np.ndarray) -> tuple[str, np.ndarray]:
    """Data path and values (T, n) of rotations (T, 3, 3)."""
    if mode == "QUATERNION":
        return "rotation_quaternion", on_one_hemisphere(quaternion_from_matrix(R))
    if mode == "AXIS_ANGLE":
        q = on_one_hemisphere(quaternion_from_matrix(R))
        size = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
        axis = np.where(size > 1e-9, q[:, 1:] / np.maximum(size, 1e-9), [0.0, 1.0, 0.0])
        return "rotation_axis_angle", np.concatenate([2 * np.arctan2(size, q[:, :1]), axis], axis=1)
    values, before = np.empty((len(R), 3)), None
    for t, matrix in enumerate(R):
        euler = Matrix(matrix.tolist()).to_euler(mode, before) if before else Matrix(matrix.tolist()).to_euler(mode)
        values[t], before = euler, euler
    return "rotation_euler", values


def _probe(rig: bpy.types.Object, parts: dict[str, str]) -> Skeleton:
    """The mapped bones at rest, ordered, with what each one follows."""
    names = list(parts)
    rest = _matrices(rig, names)
    follows = np.zeros((len(names), len(names)), bool)
    for group in _independent(parts):
        for k, a in enumerate(group):  # by another angle each, so that one sees whom a bone follows
            turn = Quaternion((0.6, 0.48, 0.64), 0.5 + 0.15 * k)
            rig.pose.bones[names[a]].matrix_basis = turn.to_matrix().to_4x4()
        turned = _rotations(_matrices(rig, names)) @ np.swapaxes(_rotations(rest), 1, 2)
        for a in group:
            rig.pose.bones[names[a]].matrix_basis = Matrix()
            follows[:, a] = np.abs(turned - turned[a]).max(axis=(1, 2)) < 0.02
            follows[a, a] = False
    order = sorted(range(len(names)), key=lambda b: int(follows[b].sum()))
    parents = []
    for b in order:
        above = [a for a in order if follows[b, a]]
        parents.append(order.index(above[-1]) if above else -1)
    matrices = rest[order]
    ends = np.array([rig.matrix_world @ rig.pose.bones[names[b]].tail for b in order])
    lowest = min((rig.matrix_world @ bone.head_local).z for bone in rig.data.bones if bone.use_deform)
    lowest = min(lowest, min((rig.matrix_world @ b.tail_local).z for b in rig.data.bones if b.use_deform))
    floor = rig.matrix_world.translation.z if abs(lowest - rig.matrix_world.translation.z) < 0.3 else lowest
    return Skeleton(
        [names[b] for b in order], np.array(parents), matrices[:, :3, 3], ends, _rotations(matrices), float(floor)
    )


def _independent(parts: dict[str, str]) -> list[list[int]]:
    """Rows of bones none of which moves another: those of both sides, and of all fingers. Each evaluation costs."""
    groups: dict[str, list[int]] = {}
    for row, (bone, part) in enumerate(parts.items()):
        side, _, kind = part.partition("_")
        key = "phalanx" + kind[-1] if kind in PHALANGES else kind
        groups.setdefault(key or bone, []).append(row)
    return list(groups.values())


def _matrices(rig: bpy.types.Object, names: list[str]) -> np.ndarray:
    """(B, 4, 4) evaluated bones to world."""
    bpy.context.view_layer.update()
    posed = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([posed.matrix_world @ posed.pose.bones[name].matrix for name in names], float)


def _rotations(matrices: np.ndarray) -> np.ndarray:
    """Their rotations, scale taken out."""
    U, _, Vt = np.linalg.svd(matrices[:, :3, :3])
    return U @ Vt


@contextmanager
def _at_rest(rig: bpy.types.Object) -> Iterator[None]:
    """The rig without animation and pose, limbs switched to FK; animation comes back, and the switches stay."""
    animation = rig.animation_data
    action = animation.action if animation else None
    slot = getattr(animation, "action_slot", None)
    nla = animation.use_nla if animation else False
    bases = [(bone, bone.matrix_basis.copy()) for bone in rig.pose.bones]
    try:
        if animation:
            animation.action, animation.use_nla = None, False
        for bone, _ in bases:
            bone.matrix_basis = Matrix()
            for switch in _SWITCHES:
                if switch in bone:
                    bone[switch] = 1.0
        rig.update_tag()
        yield
    finally:
        for bone, matrix in bases:
            bone.matrix_basis = matrix
        if animation:
            animation.use_nla = nla
            if action is not None:
                animation.action = action
                if slot is not None:
                    animation.action_slot = slot
