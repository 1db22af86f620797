# SPDX-License-Identifier: GPL-3.0-or-later
"""Retargeting captured expressions to the bones that move the face of the user's rig."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...errors import UsageError
from ...retarget.expression_map import ExpressionMap, guess_expression_map
from ...retarget.face_controls import (
    ControlMotion,
    RestBone,
    control_motions,
    guess_control_map,
    has_face_controls,
)
from ..animation_data.actions import Channels, bone_path
from ..animation_data.transaction import all_or_nothing
from .face_retarget import CapturedExpressions, key_names
from .rig_action import channel_of_rotation, leave_tweak_mode, mark_written, override_nla, retire

# change of a channel, as a share of the bone's length or in radians, below which it is none
_STILL = 1e-3
_CHANNELS = ("location", "rotation_quaternion", "rotation_axis_angle", "rotation_euler")


@dataclass(frozen=True)
class FaceKeys:
    """The keys of a face: for each of its ``controls``, channels that are not at rest, with values
    (1, n) or (T, n).
    """

    frames: NDArray[np.float64]  # (T,)
    controls: dict[str, dict[str, NDArray[np.float64]]]


def has_bone_face(rig: bpy.types.Object) -> bool:
    """Return whether bones move the face of an armature, and Scope knows which."""
    return rig.type == "ARMATURE" and has_face_controls(rig.data.bones.keys())


def only_bones_move(rig: bpy.types.Object, meshes: Iterable[bpy.types.Object]) -> bool:
    """Return whether bones move the face of an armature, and no shape keys of its meshes with names
    that are known.
    """
    return has_bone_face(rig) and not guess_expression_map(key_names(meshes)).keys


def guess_face_bones(rig: bpy.types.Object) -> ExpressionMap:
    """Return the map for the face of a rig; an empty one if it is not known."""
    return guess_control_map(rig.data.bones.keys())


def retarget_face_bones(
    captured: CapturedExpressions,
    rig: bpy.types.Object,
    expression_map: ExpressionMap,
    name: str = "Face",
) -> bpy.types.Action:
    """Key the face of a rig so that it shows the captured expressions; its other keys stay as they
    are.

    They are written to a copy of the rig's action, or to a new one. Its former action is kept in
    the file, unless retargeting has written it for the same capture and it was not edited.

    :param name: of the captured armature; the action has it after that of the rig.
    :raises UsageError: when the rig has none of the map's controls.
    :raises InputError: when the map cannot be used, or the rig's face cannot be measured.
    """
    keys = face_keys(captured, rig, expression_map)
    leave_tweak_mode(rig)  # first: a failure would assign the strip's action
    with all_or_nothing(bpy.context.scene, rig):
        former = rig.animation_data.action if rig.animation_data else None
        if former is None:
            Channels(rig, bpy.data.actions.new(rig.name))
        else:
            slot = getattr(rig.animation_data, "action_slot", None)
            rig.animation_data.action = former.copy()
            if slot is not None:
                same = (
                    s for s in rig.animation_data.action.slots if s.identifier == slot.identifier
                )
                rig.animation_data.action_slot = next(same)
        action = key_face(rig, keys, name)
        rig.data.pose_position = "POSE"
        override_nla(rig.animation_data)
        retire(former, name)
        action.name = f"{rig.name}_{name}"
    rest_face(rig, keys)
    return action


def face_keys(
    captured: CapturedExpressions, rig: bpy.types.Object, expression_map: ExpressionMap
) -> FaceKeys:
    """Return the keys of the rig's controls.

    A channel that never moves gets one key, one that stays at rest none.

    :raises UsageError: when the rig has none of the map's controls.
    :raises InputError: when the map cannot be used, or the rig's face cannot be measured.
    """
    expression_map.check()
    bones = rig.data.bones
    if not any(control in bones for control in expression_map.controls):
        raise UsageError(
            f"'{rig.name}' has none of the controls that the expression map moves; guess the "
            "expressions again, or "
            "choose another map"
        )
    rest = {
        bone.name: RestBone(
            np.array(bone.head_local, float),
            np.array(bone.matrix_local.to_3x3(), float),
            bone.use_local_location,
        )
        for bone in bones
    }
    motions = control_motions(expression_map, captured.weights, rest)
    return FaceKeys(captured.frames, {motion.bone: _channels(rig, motion) for motion in motions})


def key_face(rig: bpy.types.Object, keys: FaceKeys, source: str) -> bpy.types.Action:
    """Replace the keys of a face in the action of its rig; return the action.

    :param source: name of the captured armature.
    """
    channels = Channels.of(rig)
    channels.remove({bone_path(bone, channel) for bone in keys.controls for channel in _CHANNELS})
    for bone, moved in keys.controls.items():
        for path, values in moved.items():
            interpolation = "CONSTANT" if len(values) == 1 else "LINEAR"
            channels.write(
                bone_path(bone, path), keys.frames[: len(values)], values, interpolation, group=bone
            )
    mark_written(channels.action, source)
    return channels.action


def rest_face(rig: bpy.types.Object, keys: FaceKeys) -> None:
    """Put those controls of a face to rest that got no keys. Cannot fail."""
    for bone, moved in keys.controls.items():
        if not moved:
            rig.pose.bones[bone].matrix_basis = Matrix()


def _channels(rig: bpy.types.Object, motion: ControlMotion) -> dict[str, NDArray[np.float64]]:
    """Return the values (T, n) of a control's channels; (1, n) of those that do not move, and none
    of those at rest.
    """
    bone = rig.pose.bones[motion.bone]
    found = []
    if motion.locations is not None:
        found.append(("location", motion.locations, np.zeros(3), _STILL * bone.length))
    if motion.rotations is not None:
        name, values = channel_of_rotation(bone.rotation_mode, motion.rotations)
        found.append(
            (name, values, channel_of_rotation(bone.rotation_mode, np.eye(3)[None])[1][0], _STILL)
        )
    out = {}
    for name, values, rest, least in found:
        if np.ptp(values, axis=0).max() >= least:
            out[name] = values
        elif np.abs(values - rest).max() >= least:
            out[name] = values[:1]
    return out
