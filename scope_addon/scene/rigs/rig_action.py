# SPDX-License-Identifier: GPL-3.0-or-later
"""The action of a retargeted rig: writing its keys, and retiring the action that it replaces."""

from __future__ import annotations

import hashlib

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ....solver.rotations import quaternion_from_matrix
from ...retarget.skeleton import Skeleton
from ..animation_data.actions import Channels, bone_path, fcurves_of, read_keys
from ..character.animation import on_one_hemisphere

_CHECKSUM = "scope_keys"  # custom property of an action: the checksum of its keys when they were written


def write_action(
    rig: bpy.types.Object,
    place: NDArray[np.float64],
    skeleton: Skeleton,
    rotations: NDArray[np.float64],
    root: int,
    heads: NDArray[np.float64],
    frames: NDArray[np.float64],
) -> bpy.types.Action:
    """Create a new action with the keys, in the rotation mode of each bone.

    :param place: (4, 4) the rig's object to world at rest.
    :param rotations: (T, B, 3, 3) of the channels.
    :param root: index of the root bone.
    :param heads: (T, 3) positions of the root bone's head, metres, in the world at rest.
    :param frames: (T,) scene frames.
    """
    action = bpy.data.actions.new(rig.name)
    channels = Channels(rig, action)
    for b, bone_name in enumerate(skeleton.names):
        bone = rig.pose.bones[bone_name]
        path, values = _rotation_channel(bone.rotation_mode, rotations[:, b])
        channels.write(bone_path(bone_name, path), frames, values, group=bone_name)
    bone = rig.pose.bones[skeleton.names[root]]
    world = place[:3, :3]
    moved = (heads - skeleton.heads[root]) @ np.linalg.inv(world).T
    if bone.bone.use_local_location:
        axes = skeleton.rotations[root].T @ (world / np.cbrt(np.linalg.det(world)))
        moved = moved @ axes.T
    channels.write(bone_path(bone.name, "location"), frames, moved, group=bone.name)
    action[_CHECKSUM] = _checksum(action)
    return action


def override_nla(animation: bpy.types.AnimData) -> None:
    """Make the active action replace the NLA tracks below it for its bones, whatever the former action's blending."""
    animation.action_blend_type, animation.action_influence = "REPLACE", 1.0
    for track in animation.nla_tracks:
        track.is_solo = False  # a solo track would silence the action


def retire(former: bpy.types.Action | None) -> None:
    """Keep the rig's former action in the file, unless it is an earlier retargeting that was not edited."""
    if former is None:
        return
    if former.get(_CHECKSUM) == _checksum(former) and former.users == 0:
        bpy.data.actions.remove(former)
    else:
        former.use_fake_user = True


def _checksum(action: bpy.types.Action) -> str:
    """Return a checksum of the keys, to detect edits."""
    found = hashlib.sha256()
    for curve in fcurves_of(action):
        found.update(f"{curve.data_path}[{curve.array_index}] {len(curve.modifiers)}".encode())
        found.update(read_keys(curve).tobytes())
    return found.hexdigest()


def _rotation_channel(mode: str, R: NDArray[np.float64]) -> tuple[str, NDArray[np.float64]]:
    """Return the data path and the values (T, n) of rotations (T, 3, 3) in a bone's rotation mode."""
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
