# SPDX-License-Identifier: GPL-3.0-or-later
"""Retargeting captured expressions to the shape keys of the user's own meshes, or to the bones
that move the face of their rig, as new actions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from bpy.types import Action, Key, Object
from mathutils import Matrix

from ..arrays import Float64Array
from ..errors import UsageError
from ..kinematics.face import EXPRESSIONS
from ..notices import Notice, notice
from ..retarget.expression_map import ExpressionMap, guess_expression_map
from ..retarget.face_controls import (
    RestBone,
    control_motions,
    guess_control_map,
    has_face_controls,
)
from ..retarget.rest_pose import BoneMotion
from .actions import (
    Channels,
    assign_action,
    bone_path,
    check_not_in_nla,
    fcurves,
    is_cyclic,
    read_keys,
    repeat_curve,
    shape_key_path,
    used_slot,
)
from .character.body_mesh import MOVES, has_expression_keys
from .datablocks import action_of
from .rig_action import (
    channel_of_rotation,
    leave_tweak_mode,
    location_axes,
    mark_written,
    override_nla,
    replace_action,
    retire,
)
from .transaction import all_or_nothing

# change of a channel, as a share of the bone's length or in radians, below which it is none
_STILL = 1e-3
_CHANNELS = ("location", "rotation_quaternion", "rotation_axis_angle", "rotation_euler")


@dataclass(frozen=True)
class CapturedExpressions:
    """The expressions of a captured person: weights (T, 52) in the order of `EXPRESSIONS`, at scene
    frames (T,), and whether they repeat.
    """

    frames: Float64Array
    weights: Float64Array
    repeat: bool = False


def captured_expressions(armature: Object) -> CapturedExpressions | None:
    """Return the expressions that the captured armature's body shows; None if its face was not
    captured.

    :raises UsageError: their keys are in the NLA.
    """
    for mesh in armature.children:
        keys = mesh.data.shape_keys if mesh.type == "MESH" else None
        if keys is None or not has_expression_keys(keys):
            continue
        if not fcurves(keys):
            check_not_in_nla(keys)
        curves = {curve.data_path: read_keys(curve).astype(float) for curve in fcurves(keys)}
        found = [curves.get(shape_key_path(name)) for name in EXPRESSIONS]
        longest = max(
            (keyed[:, 0] for keyed in found if keyed is not None and len(keyed)),
            key=len,
            default=np.ones(1),
        )
        columns = [
            np.interp(longest, *keyed.T)
            if keyed is not None and len(keyed)
            else np.full(len(longest), block.value)
            for keyed, block in (
                (k, keys.key_blocks[name]) for k, name in zip(found, EXPRESSIONS, strict=True)
            )
        ]
        return CapturedExpressions(longest, np.stack(columns, axis=1), is_cyclic(keys))
    return None


def faces_of(objects: Iterable[Object]) -> list[Object]:
    """Return the meshes with shape keys, one of those that share their data."""
    found = {
        obj.data: obj for obj in objects if obj.type == "MESH" and obj.data.shape_keys is not None
    }
    return list(found.values())


def key_names(faces: Iterable[Object]) -> list[str]:
    """Return the names of all shape keys of meshes but the basis, each once."""
    blocks = (block for face in faces for block in face.data.shape_keys.key_blocks[1:])
    return list(dict.fromkeys(block.name for block in blocks))


def retarget_expressions(
    captured: CapturedExpressions,
    faces: Sequence[Object],
    expression_map: ExpressionMap | None = None,
    name: str = "Face",
) -> list[Action]:
    """Key the shape keys of meshes in new actions so that they show the captured expressions.

    A mesh's former action is kept in the file, unless it is an earlier retargeting of the same
    capture that was not edited. A key that never moves gets a value without keyframes; sliders
    whose range ends below 1 are widened to it.

    :param expression_map: None to guess one for each mesh by the names of its keys.
    :param name: of the captured armature; the actions have it after that of the mesh.
    :return: the actions, of the meshes that have mapped keys.
    :raises UsageError: when no mesh has any mapped key.
    :raises InputError: when the map cannot be used.
    """
    if expression_map is not None:
        expression_map.check()
    plans = []
    for face in faces:
        names = key_names([face])
        wanted = (expression_map or guess_expression_map(names)).values(captured.weights)
        plans.append((face, {key: values for key, values in wanted.items() if key in names}))
    if not any(values for _, values in plans):
        meshes = ", ".join(f"'{face.name}'" for face in faces) or "the rig's meshes"
        raise UsageError(
            f"no shape key of {meshes} is mapped to an expression; name them as ARKit, VRM or "
            "Oculus do, or give a map"
        )
    written = []
    for face in faces:
        leave_tweak_mode(face.data.shape_keys)  # first: a failure would assign the strip's action
    with all_or_nothing(bpy.context.scene, *faces, keys=[face.data.shape_keys for face in faces]):
        for face, values in plans:
            if values:
                written.append((face, *_write(face.data.shape_keys, captured, values, name)))
        for face, action, former in written:
            retire(former, name)
            action.name = f"{face.name}_{name}"  # which an earlier retargeting had until now
    return [action for _, action, _ in written]


def driven_keys(
    faces: Iterable[Object], expression_map: ExpressionMap | None = None
) -> list[Notice]:
    """Return warnings about mapped shape keys that do not show their keyframes, because drivers
    move them.

    :param expression_map: None for a guess, as `retarget_expressions` makes it.
    """
    warnings = []
    for face in faces:
        keys = face.data.shape_keys
        drivers = keys.animation_data.drivers if keys.animation_data else ()
        driven = {driver.data_path for driver in drivers if not driver.mute}
        mapped = expression_map or guess_expression_map(key_names([face]))
        blocked = [key for key in mapped.keys if shape_key_path(key) in driven]
        if blocked:
            warnings.append(notice("driven_keys", mesh=face.name, keys=blocked))
    return warnings


def _write(
    keys: Key, captured: CapturedExpressions, values: dict[str, Float64Array], source: str
) -> tuple[Action, Action | None]:
    """Write the keys of one mesh; return the new action and the former one."""
    former = action_of(keys)
    channels = Channels(keys, bpy.data.actions.new("Face"))
    for key, column in values.items():
        block = keys.key_blocks[key]
        block.slider_max = max(block.slider_max, 1.0)
        block.mute = False
        block.value = float(column[0])
        if np.ptp(column) >= MOVES:
            curves = channels.write(shape_key_path(key), captured.frames, column, group="Face")
            if captured.repeat:
                repeat_curve(curves[0])
    override_nla(keys.animation_data)
    mark_written(channels.action, source)
    return channels.action, former


@dataclass(frozen=True)
class FaceKeys:
    """The keys of a face: for each of its ``controls``, channels that are not at rest, with values
    (1, n) or (T, n); and whether they repeat.
    """

    frames: Float64Array  # (T,)
    controls: dict[str, dict[str, Float64Array]]
    repeat: bool = False


def has_bone_face(rig: Object) -> bool:
    """Return whether bones move the face of an armature, and Scope knows which."""
    return rig.type == "ARMATURE" and has_face_controls(rig.data.bones.keys())


def only_bones_move(rig: Object, meshes: Iterable[Object]) -> bool:
    """Return whether bones move the face of an armature, and no shape keys of its meshes with names
    that are known.
    """
    return has_bone_face(rig) and not guess_expression_map(key_names(meshes)).keys


def guess_face_bones(rig: Object) -> ExpressionMap:
    """Return the map for the face of a rig; an empty one if it is not known."""
    return guess_control_map(rig.data.bones.keys())


def retarget_face_bones(
    captured: CapturedExpressions, rig: Object, expression_map: ExpressionMap, name: str = "Face"
) -> Action:
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
        former = action_of(rig)
        if former is None:
            Channels(rig, bpy.data.actions.new(rig.name))
        else:
            assign_action(rig.animation_data, former.copy(), used_slot(rig.animation_data))
        action = key_face(rig, keys, name)
        replace_action(rig, former, name)
    rest_face(rig, keys)
    return action


def face_keys(
    captured: CapturedExpressions, rig: Object, expression_map: ExpressionMap
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
            location_axes(bone),
        )
        for bone in bones
    }
    motions = control_motions(expression_map, captured.weights, rest)
    controls = {motion.bone: _channels(rig, motion) for motion in motions}
    return FaceKeys(captured.frames, controls, captured.repeat)


def key_face(rig: Object, keys: FaceKeys, source: str) -> Action:
    """Replace the keys of a face in the action of its rig; return the action.

    :param source: name of the captured armature.
    """
    channels = Channels.of(rig)
    channels.remove({bone_path(bone, channel) for bone in keys.controls for channel in _CHANNELS})
    for bone, moved in keys.controls.items():
        for path, values in moved.items():
            interpolation = "CONSTANT" if len(values) == 1 else "LINEAR"
            curves = channels.write(
                bone_path(bone, path), keys.frames[: len(values)], values, interpolation, group=bone
            )
            for curve in curves if keys.repeat else ():
                repeat_curve(curve)
    mark_written(channels.action, source)
    return channels.action


def rest_face(rig: Object, keys: FaceKeys) -> None:
    """Put those controls of a face to rest that got no keys. Cannot fail."""
    for bone, moved in keys.controls.items():
        if not moved:
            rig.pose.bones[bone].matrix_basis = Matrix()


def _channels(rig: Object, motion: BoneMotion) -> dict[str, Float64Array]:
    """Return the values (T, n) of a control's channels; (1, n) of those that do not move, and none
    of those at rest.
    """
    assert motion.locations is not None
    bone = rig.pose.bones[motion.bone]
    name, values = channel_of_rotation(bone.rotation_mode, motion.rotations)
    _, (at_rest,) = channel_of_rotation(bone.rotation_mode, np.eye(3)[None])
    found = [
        ("location", motion.locations, np.zeros(3), _STILL * bone.length),
        (name, values, at_rest, _STILL),
    ]
    out = {}
    for name, values, rest, least in found:
        if np.ptp(values, axis=0).max() >= least:
            out[name] = values
        elif np.abs(values - rest).max() >= least:
            out[name] = values[:1]
    return out
