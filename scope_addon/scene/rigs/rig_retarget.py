# SPDX-License-Identifier: GPL-3.0-or-later
"""A captured motion on the user's own rig, as a new action.

What follows what is tried out on the rig itself: each mapped bone is turned once and the others are looked at. So
constraints, as Rigify's controls have them, need no knowledge of their own, and no frame has to be evaluated.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Quaternion
from numpy.typing import NDArray

from ....solver.body import Body
from ....solver.errors import InputError
from ....solver.rotations import quaternion_from_matrix
from ...edit.root_motion import about_z, floor_trajectory
from ...errors import UsageError
from ...retarget.bone_map import PHALANGES, BoneMap
from ...retarget.guess import RestBones, guess
from ...retarget.rig_source import ROOTS
from ...retarget.skeleton import Skeleton, basis
from ...retarget.transfer import transfer
from ..animation_data.actions import Channels, bone_path, fcurves_of, read_keys
from ..animation_data.transaction import all_or_nothing
from ..character.animation import on_one_hemisphere
from ..character.keys import read_clip
from ..character.root_object import (
    carried,
    clip_as_displayed,
    parent_to_root_object,
    remove_root_object,
    root_object,
    topmost,
)

# Rigify's switches: limbs by FK, neck and head with the chest.
_SWITCHES = ("IK_FK", "neck_follow", "head_follow")
_CARRIED = 0.02  # of its distance from the bone that carries it a head may be elsewhere
_TURNS = 0.1  # of a rotation matrix's numbers, which the probe changes by more than 0.3
_LOOKS, _HELD = 5, np.radians(20)  # at so many frames a bone may be off by so much
_WRITTEN = "scope_keys"  # custom property of an action: what its keys were when they were written


@dataclass(frozen=True)
class RetargetOptions:
    """What the user may choose."""

    feet: bool = True  # feet stand where the body's do
    root: str = "bone"  # where the way over the floor is kept: one of ``ROOTS``
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # metres that the rig stands aside from the captured person

    def __post_init__(self) -> None:
        """Refuse values that are not offered."""
        if self.root not in ROOTS:
            raise UsageError(f"root must be one of {', '.join(ROOTS)}, but is '{self.root}'")


@dataclass(frozen=True)
class RetargetResult:
    """What ``retarget`` did: the rig's new action, and what the user should know of it."""

    action: bpy.types.Action
    warnings: list[str]


def guess_bone_map(rig: bpy.types.Object) -> BoneMap:
    """Guess by the rig's names and rest pose. :raises InputError: it has no bones."""
    bones = list(rig.data.bones)
    if not bones:
        raise InputError(f"'{rig.name}' has no bones; choose another armature as the rig")
    names = [bone.name for bone in bones]
    parents = np.array([names.index(bone.parent.name) if bone.parent else -1 for bone in bones], int)
    heads = np.array([rig.matrix_world @ bone.head_local for bone in bones]).reshape(-1, 3)
    return guess(RestBones(names, parents, heads))


def retarget(
    source: bpy.types.Object,
    body: Body,
    betas: NDArray[np.float64],
    rig: bpy.types.Object,
    bone_map: BoneMap,
    rate: float,
    options: RetargetOptions | None = None,
) -> RetargetResult:
    """Key the mapped bones of ``rig`` so that it moves as the captured ``source``, in a new action.

    The rig's former action stays in the file, but one that came of retargeting and is as it was written. Fingers stay
    as they are where none were captured. The rig leaves Edit Mode, Rest Position and its NLA's Tweak Mode, in which it
    would not move; tracks of its NLA stay, below the new action.

    :raises UsageError: the rig is the source, or has no such bones.
    :raises InputError: the map cannot be used, or the rig does not move with its bones.
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
    clip = clip_as_displayed(source, clip, frames)
    if rig.animation_data and rig.animation_data.use_tweak_mode:  # in which no action can be set
        rig.animation_data.use_tweak_mode = False
    with all_or_nothing(bpy.context.scene, rig, topmost(rig)):
        with _at_rest(rig):
            skeleton, place = _probe(rig, bone_map.parts), np.array(rig.matrix_world, float)
            pose = transfer(clip, body, betas, skeleton, bone_map, feet=options.feet)
            root = skeleton.names.index(bone_map.bone("pelvis") or "")
            rotations, heads, yaw = _where_seen(source, pose.rotations, pose.heads[:, root])
            heads += options.offset
            way = None
            if options.root == "in-place":
                heads[:, :2] = skeleton.heads[root, :2]
            elif options.root == "object":
                positions, angles = heads * [1.0, 1.0, 0.0], floor_trajectory(clip)[1] + yaw + pose.facing
                turn, origin = about_z(angles), place[:3, 3] * [1.0, 1.0, 0.0]
                rotations = np.swapaxes(turn, 1, 2)[:, None] @ rotations
                heads = np.einsum("tji,tj->ti", turn, heads - positions) + origin
                way = positions - turn @ origin, angles
            turns = basis(skeleton, rotations)
            warnings = _held_back(rig, skeleton.names, turns, rotations)
        former = rig.animation_data.action if rig.animation_data else None
        action = _write(rig, place, skeleton, turns, root, heads, frames)
        hanging = topmost(rig)
        if way is None:
            remove_root_object(rig)
        else:
            hanging = parent_to_root_object(rig, frames, *way)
        if hanging.parent is not None:  # the keys say where in the world it is
            hanging.matrix_parent_inverse = hanging.matrix_parent_inverse @ carried(hanging).inverted_safe()
        rig.data.pose_position = "POSE"
        _above_nla(rig.animation_data)
        _put_by(former)
        action.name = f"{rig.name}_{source.name}"
    return RetargetResult(action, warnings)


def check_bones_move(rig: bpy.types.Object, bone_map: BoneMap) -> None:
    """Whether the mapped bones can be turned, and the pelvis moved. :raises InputError: one of them cannot."""
    with _at_rest(rig):
        _probe(rig, bone_map.parts)


def _where_seen(
    source: bpy.types.Object, rotations: NDArray[np.float64], heads: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Moved and turned as the user has moved and turned the captured armature; and by how much about the upright axis.

    A root object's way is in the motion already, but not where its parent takes it. How large the armature is drawn
    says nothing of the rig.

    :param rotations: (T, B, 3, 3); heads: (T, 3).
    """
    bpy.context.view_layer.update()
    empty = root_object(source)
    place, turn, _ = (source.matrix_world if empty is None else carried(empty)).decompose()
    R = np.array(turn.to_matrix())
    return R @ rotations, heads @ R.T + np.array(place), float(turn.to_euler("ZYX").z)


def _write(
    rig: bpy.types.Object,
    place: NDArray[np.float64],
    skeleton: Skeleton,
    rotations: NDArray[np.float64],
    root: int,
    heads: NDArray[np.float64],
    frames: NDArray[np.float64],
) -> bpy.types.Action:
    """A new action with the keys, each bone's in the mode that it has.

    :param place: (4, 4) the rig's object to world at rest; rotations: (T, B, 3, 3) of the channels; heads: (T, 3) where
        the root bone belongs, in the world at rest.
    """
    action = bpy.data.actions.new(rig.name)
    channels = Channels(rig, action)
    curves = []
    for b, bone_name in enumerate(skeleton.names):
        bone = rig.pose.bones[bone_name]
        path, values = _channel(bone.rotation_mode, rotations[:, b])
        curves += channels.write(bone_path(bone_name, path), frames, values, group=bone_name)
    bone = rig.pose.bones[skeleton.names[root]]
    world = place[:3, :3]
    moved = (heads - skeleton.heads[root]) @ np.linalg.inv(world).T
    if bone.bone.use_local_location:
        axes = skeleton.rotations[root].T @ (world / np.cbrt(np.linalg.det(world)))
        moved = moved @ axes.T
    channels.write(bone_path(bone.name, "location"), frames, moved, group=bone.name)
    action[_WRITTEN] = _checksum(action)
    return action


def _above_nla(animation: bpy.types.AnimData) -> None:
    """Let the action replace what the tracks below it do to the same bones, whatever the one before was meant for."""
    animation.action_blend_type, animation.action_influence = "REPLACE", 1.0
    for track in animation.nla_tracks:
        track.is_solo = False  # alone, it would silence the action


def _put_by(former: bpy.types.Action | None) -> None:
    """Keep the rig's former action in the file, but for one of an earlier retargeting that nobody has worked on."""
    if former is None:
        return
    if former.get(_WRITTEN) == _checksum(former) and former.users == 0:
        bpy.data.actions.remove(former)
    else:
        former.use_fake_user = True


def _checksum(action: bpy.types.Action) -> str:
    """Tells whether keys have been changed."""
    found = hashlib.sha256()
    for curve in fcurves_of(action):
        found.update(f"{curve.data_path}[{curve.array_index}] {len(curve.modifiers)}".encode())
        found.update(read_keys(curve).tobytes())
    return found.hexdigest()


def _channel(mode: str, R: NDArray[np.float64]) -> tuple[str, NDArray[np.float64]]:
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
    """The mapped bones at rest, ordered, with what each one follows.

    :raises InputError: one of them does not turn, the pelvis does not move, or the rig has no size.
    """
    names = list(parts)
    rest = _matrices(rig, names)
    if min(map(abs, rig.matrix_world.to_scale())) < 1e-9:
        raise InputError(f"'{rig.name}' is scaled to 0; give it a size (S, or Scale in the sidebar)")
    follows = np.zeros((len(names), len(names)), bool)  # row by column: turns with it
    carried = follows.copy()  # its head goes with it
    heads = rest[:, :3, 3]
    for group in _independent(parts):
        for k, a in enumerate(group):  # by another angle each, so that one sees whom a bone follows
            turn = Quaternion((0.6, 0.48, 0.64), 0.5 + 0.15 * k)
            rig.pose.bones[names[a]].matrix_basis = turn.to_matrix().to_4x4()
        posed = _matrices(rig, names)
        turned = _rotations(posed) @ np.swapaxes(_rotations(rest), 1, 2)
        _check_turned(rig, [names[a] for a in group], turned[group])
        for a in group:
            rig.pose.bones[names[a]].matrix_basis = Matrix()
            follows[:, a] = np.abs(turned - turned[a]).max(axis=(1, 2)) < 0.02
            away = heads - heads[a]
            expected = away @ turned[a].T
            off, moved = (np.linalg.norm(expected - now, axis=1) for now in (posed[:, :3, 3] - heads[a], away))
            carried[:, a] = (off < _CARRIED * np.linalg.norm(away, axis=1)) & (off < moved)
            follows[a, a] = carried[a, a] = False
    _check_moved(rig, next((bone for bone, part in parts.items() if part == "pelvis"), names[0]))
    order: list[int] = []
    while rows := [b for b in range(len(names)) if b not in order]:
        above = {b: sum(a not in order for a in np.flatnonzero(follows[b] | carried[b])) for b in rows}
        order.append(min(rows, key=above.__getitem__))
    parents, carriers = (_nearest(above[np.ix_(order, order)]) for above in (follows, carried))
    carriers = np.where(carriers < 0, parents, carriers)
    matrices = rest[order]
    ends = matrices[:, :3, 3] + matrices[:, :3, 1] * [[rig.pose.bones[names[b]].length] for b in order]
    deforming = [bone for bone in rig.data.bones if bone.use_deform] or rig.data.bones
    lowest = min((rig.matrix_world @ end).z for bone in deforming for end in (bone.head_local, bone.tail_local))
    floor = rig.matrix_world.translation.z if abs(lowest - rig.matrix_world.translation.z) < 0.3 else lowest
    return Skeleton(
        [names[b] for b in order], parents, carriers, matrices[:, :3, 3], ends, _rotations(matrices), float(floor)
    )


def _nearest(above: NDArray[np.float64]) -> NDArray[np.float64]:
    """(B,) the last of the bones before that each one goes with, -1 without any; ``above``: (B, B), row by column."""
    return np.array([max(np.flatnonzero(row[:b]), default=-1) for b, row in enumerate(above)], int)


def _check_turned(rig: bpy.types.Object, names: list[str], turned: NDArray[np.float64]) -> None:
    """Of a bone that stays where it is, every other one that stays would seem to follow it.

    :param turned: (B, 3, 3) by how much each of these bones did turn.
    """
    held = [name for name, R in zip(names, turned, strict=True) if np.abs(R - np.eye(3)).max() < _TURNS]
    if held:
        raise InputError(
            f"'{held[0]}' of '{rig.name}' does not move when it is turned: show the rig in the viewport, mute the "
            "constraint or driver that holds the bone, or take it out of the list"
        )


def _check_moved(rig: bpy.types.Object, name: str) -> None:
    """The pelvis carries the way over the floor, so it has to go where its location says. Leaves it at rest.

    :raises InputError: it stays where it is.
    """
    bone, rest = rig.pose.bones[name], _matrices(rig, [name])
    bone.matrix_basis = Matrix.Translation((bone.length,) * 3)
    moved = np.linalg.norm(np.linalg.solve(np.array(rig.matrix_world), _matrices(rig, [name]) - rest)[0, :3, 3])
    bone.matrix_basis = Matrix()
    if moved > 0.1 * bone.length:
        return
    if bone.bone.use_connect:
        raise InputError(
            f"'{name}' of '{rig.name}' is connected to '{bone.parent.name}' and cannot leave it: in Edit Mode, "
            "disconnect the bone (Alt P)"
        )
    raise InputError(
        f"'{name}' of '{rig.name}' does not move when its location changes: mute the constraint or driver that holds "
        "the bone, or choose another one for the pelvis in the list"
    )


def _held_back(rig: bpy.types.Object, names: list[str], turns: NDArray[np.float64], wanted: NDArray[np.float64]) -> list[str]:
    """Warns of bones that do not go where they should though they can be turned, as those of a leg by IK.

    :param turns: (T, B, 3, 3) rotations of the channels; wanted: (T, B, 3, 3) where they should turn the bones to.
    """
    off = np.zeros(len(names))
    for t in np.unique(np.linspace(0, len(turns) - 1, _LOOKS).astype(int)):
        for name, turn in zip(names, turns[t], strict=True):
            rig.pose.bones[name].matrix_basis = Matrix(turn.tolist()).to_4x4()
        seen = _rotations(_matrices(rig, names))
        cosine = (np.einsum("bij,bij->b", seen, wanted[t]) - 1) / 2
        off = np.maximum(off, np.arccos(np.clip(cosine, -1, 1)))
    held = [name for name, angle in zip(names, off, strict=True) if angle > _HELD]
    if not held:
        return []
    others = {1: "", 2: f" and '{held[-1]}'"}.get(len(held), f" and {len(held) - 1} other bones")
    return [
        f"'{held[0]}'{others} of '{rig.name}' cannot follow: mute the constraints or drivers that hold them, such as "
        "IK, or put the bones that control them into the list"
    ]


def _independent(parts: dict[str, str]) -> list[list[int]]:
    """Rows of bones none of which moves another: those of both sides, and of all fingers. Each evaluation costs."""
    groups: dict[str, list[int]] = {}
    for row, (bone, part) in enumerate(parts.items()):
        side, _, kind = part.partition("_")
        key = "phalanx" + kind[-1] if kind in PHALANGES else kind
        groups.setdefault(key or bone, []).append(row)
    return list(groups.values())


def _matrices(rig: bpy.types.Object, names: list[str]) -> NDArray[np.float64]:
    """(B, 4, 4) evaluated bones to world."""
    bpy.context.view_layer.update()
    posed = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([posed.matrix_world @ posed.pose.bones[name].matrix for name in names], float)


def _rotations(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Their rotations, scale taken out."""
    U, _, Vt = np.linalg.svd(matrices[:, :3, :3])
    return U @ Vt


@contextmanager
def _at_rest(rig: bpy.types.Object) -> Iterator[None]:
    """The rig without animation, pose and root object, limbs switched to FK, where Blender evaluates it.

    All comes back, but the switches and Edit Mode.
    """
    if rig.mode == "EDIT":
        bpy.ops.object.mode_set(mode="OBJECT")
    shown = bpy.context.scene.collection.objects  # which cannot be hidden or excluded, as others can
    hidden, linked = rig.hide_viewport, rig in shown.values()
    position = rig.data.pose_position
    animation = rig.animation_data
    action = animation.action if animation else None
    slot = getattr(animation, "action_slot", None)
    nla = animation.use_nla if animation else False
    bases = [(bone, bone.matrix_basis.copy()) for bone in rig.pose.bones]
    top, empty = topmost(rig), root_object(rig)
    try:
        if not linked:
            shown.link(rig)
        rig.hide_viewport, rig.data.pose_position = False, "POSE"
        top.parent = None
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
        top.parent = empty
        rig.hide_viewport, rig.data.pose_position = hidden, position
        if not linked:
            shown.unlink(rig)
        if animation:
            animation.use_nla = nla
            if action is not None:
                animation.action = action
                if slot is not None:
                    animation.action_slot = slot
