# SPDX-License-Identifier: GPL-3.0-or-later
"""The action of a retargeted rig: writing its keys, and retiring the action that it replaces."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

import bpy
import numpy as np
from bpy.types import ID, Action, AnimData, Object
from mathutils import Matrix

from ..arrays import Float64Array
from ..kinematics.smoothing import continuous_quaternions
from ..retarget.rest_pose import BoneMotion, Skeleton
from .actions import Channels, bone_path, fcurves, fcurves_of, nla_fcurves, read_keys
from .character.root_object import root_object
from .stored_values import KEYS_OF, source_of, stored_text
from .timing import Retiming, retime_keys

# custom property of an action: the checksum of its keys when they were written
_CHECKSUM = "scope_keys"
# the same: that of the captured armature's values, of which they were made
_SOURCE_CHECKSUM = "scope_source_keys"
# channels of a bone beside its rotation, and their values at rest
_OFFSETS = {"location": 0.0, "scale": 1.0}


def root_locations(
    rig: Object, place: Float64Array, skeleton: Skeleton, root: int, heads: Float64Array
) -> Float64Array:
    """Return the location channel (T, 3) of the root bone.

    :param place: (4, 4) the rig's object to world at rest.
    :param root: index of the root bone.
    :param heads: (T, 3) positions of the root bone's head, metres, in the world at rest.
    """
    world = place[:3, :3]
    moved: Float64Array = (heads - skeleton.heads[root]) @ np.linalg.inv(world).T
    # not by the bone's axes in the world, which a scale of three factors shears
    return moved @ location_axes(rig.data.bones[skeleton.names[root]])


def location_axes(bone: bpy.types.Bone) -> Float64Array:
    """Return the axes (3, 3) of a bone's location channel at rest as columns, in the armature's
    space: its own, or, without *Local Location*, those of its parent.
    """
    owner = bone if bone.use_local_location else bone.parent
    return np.array(owner.matrix_local.to_3x3(), float) if owner is not None else np.eye(3)


def write_action(rig: Object, keys: list[BoneMotion], frames: Float64Array, source: str) -> Action:
    """Create a new action with the keys, in the rotation mode of each bone.

    Where the NLA moves or scales one of the bones, a key keeps it in place and in size.

    :param frames: (T,) scene frames.
    :param source: name of the captured armature.
    """
    action = bpy.data.actions.new(rig.name)
    channels = Channels(rig, action)
    for key in keys:
        path, values = channel_of_rotation(rig.pose.bones[key.bone].rotation_mode, key.rotations)
        channels.write(bone_path(key.bone, path), frames, values, group=key.bone)
    for key in keys:
        if key.locations is not None:
            channels.write(bone_path(key.bone, "location"), frames, key.locations, group=key.bone)
    below = {curve.data_path for curve in nla_fcurves(rig)}
    for key in keys:
        for channel, value in _OFFSETS.items():
            if (path := bone_path(key.bone, channel)) in below and (
                channel != "location" or key.locations is None
            ):
                channels.write(path, frames[:1], np.full((1, 3), value), "CONSTANT", group=key.bone)
    mark_written(action, source)
    return action


def mark_written(action: Action, source: str = "") -> None:
    """Remember the keys that retargeting has written, to tell later whether they were edited.

    :param source: name of the captured armature whose motion they are; empty: as before.
    """
    action[_CHECKSUM] = _checksum(action)
    if source:
        action[KEYS_OF] = source


def remember_motion(action: Action, source: Object) -> None:
    """Remember the motion that a captured armature has, to tell later whether it was corrected."""
    action[_SOURCE_CHECKSUM] = _checksum_of_motion(source)


def is_outdated(action: Action, source: Object) -> bool:
    """Return whether a captured armature moves otherwise than when retargeting wrote its motion to
    the action; False if that has the motion of another one.
    """
    known = stored_text(action, _SOURCE_CHECKSUM)
    is_own = bool(known) and source_of(action) == source.name
    return is_own and known != _checksum_of_motion(source)


def up_to_date(source: Object) -> list[Action]:
    """Return the actions that have a captured armature's present motion."""
    return [
        action
        for action in bpy.data.actions
        if action.library is None
        and _SOURCE_CHECKSUM in action
        and source_of(action) == source.name
        and not is_outdated(action, source)
    ]


def _checksum_of_motion(source: Object) -> str:
    """Return a checksum of the values of an armature's keys and its root object's, whose times
    another frame rate changes.
    """
    found = hashlib.sha256()
    curves = [curve for obj in (source, root_object(source)) if obj for curve in fcurves(obj)]
    for curve in sorted(curves, key=lambda curve: (curve.data_path, curve.array_index)):
        found.update(f"{curve.data_path}[{curve.array_index}]".encode())
        found.update(read_keys(curve)[:, 1].tobytes())
    return found.hexdigest()


def follow_renaming(names: dict[str, str]) -> None:
    """Remember the new names of captured armatures, by their former ones, with the actions that
    have their motion.
    """
    for action in bpy.data.actions:
        if action.library is None and (name := names.get(source_of(action))):
            action[KEYS_OF] = name


def clear_offsets(rig: Object, bones: Iterable[str]) -> None:
    """Undo what the pose moves and scales bones by; retargeting only turns them, and measured them
    without it.

    Cannot fail.
    """
    for name in bones:
        for channel, value in _OFFSETS.items():
            setattr(rig.pose.bones[name], channel, (value,) * 3)


def leave_tweak_mode(animated: ID) -> None:
    """Leave the NLA's Tweak Mode, in which no action can be assigned."""
    if animated.animation_data and animated.animation_data.use_tweak_mode:
        animated.animation_data.use_tweak_mode = False


def override_nla(animation: AnimData) -> None:
    """Make the active action replace the NLA tracks below it for its bones, whatever the former
    action's blending.
    """
    animation.action_blend_type = "REPLACE"
    animation.action_influence = 1.0
    for track in animation.nla_tracks:
        track.is_solo = False  # a solo track would silence the action


def retire(former: Action | None, source: str) -> None:
    """Keep the rig's former action in the file, unless it is an earlier retargeting that was not
    edited.

    :param source: name of the captured armature whose motion the rig has now; that of another one
        is kept.
    """
    if former is None:
        return
    is_same = former.get(KEYS_OF, source) == source
    if is_same and is_retargeted(former) and not is_edited(former) and former.users == 0:
        bpy.data.actions.remove(former)
    else:
        former.use_fake_user = True


def replace_action(rig: Object, former: Action | None, source: str) -> None:
    """Let a rig show its new action in place of the former one; name it after rig and capture.

    :param source: name of the captured armature.
    """
    rig.data.pose_position = "POSE"
    override_nla(rig.animation_data)
    retire(former, source)
    rig.animation_data.action.name = f"{rig.name}_{source}"


def retime_written_keys(action: Action, retiming: Retiming) -> None:
    """Move the keys of a retargeted action; it counts as edited only if it was."""
    edited = is_edited(action)
    retime_keys(fcurves_of(action), retiming)
    if not edited:
        mark_written(action)


def is_retargeted(action: Action) -> bool:
    """Return whether retargeting has written the action."""
    return _CHECKSUM in action


def is_edited(action: Action) -> bool:
    """Return whether the keys of an action that retargeting has written were changed since."""
    return is_retargeted(action) and action[_CHECKSUM] != _checksum(action)


def _checksum(action: Action) -> str:
    """Return a checksum of the keys, to detect edits."""
    found = hashlib.sha256()
    for curve in fcurves_of(action):
        found.update(f"{curve.data_path}[{curve.array_index}] {len(curve.modifiers)}".encode())
        found.update(read_keys(curve).tobytes())
    return found.hexdigest()


def channel_of_rotation(mode: str, R: Float64Array) -> tuple[str, Float64Array]:
    """Return the data path and the values (T, n) of rotations (T, 3, 3) in a bone's rotation
    mode.
    """
    if mode == "QUATERNION":
        return "rotation_quaternion", continuous_quaternions(R)
    if mode == "AXIS_ANGLE":
        q = continuous_quaternions(R)
        size = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
        axis = np.where(size > 1e-9, q[:, 1:] / np.maximum(size, 1e-9), [0.0, 1.0, 0.0])
        return "rotation_axis_angle", np.concatenate([2 * np.arctan2(size, q[:, :1]), axis], axis=1)
    values = np.empty((len(R), 3))
    before = None
    for t, matrix in enumerate(R):
        euler = (
            Matrix(matrix.tolist()).to_euler(mode, before)
            if before
            else Matrix(matrix.tolist()).to_euler(mode)
        )
        values[t] = euler
        before = euler
    return "rotation_euler", values
