# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of expressions of the chosen face: a mesh with shape keys, or a rig whose bones move the
face.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy

if TYPE_CHECKING:
    from ...retarget.expression_map import ExpressionMap

SHAPE_KEY = "key"  # the channel of entries of shape keys


def bones_move(face: bpy.types.Object | None) -> bool:
    """Return whether a face is a rig whose bones move it, and Scope knows which."""
    from ...scene.rigs.face_bones import has_bone_face

    return face is not None and "scope_source" not in face and has_bone_face(face)


def has_targets(face: bpy.types.Object | None) -> bool:
    """Return whether an object is a face: it has shape keys, or bones move it."""
    if face is not None and face.type == "MESH":
        return face.data.shape_keys is not None
    return bones_move(face)


def target_names(face: bpy.types.Object) -> list[str]:
    """Return the names of a face's shape keys or bones."""
    return list(
        (face.data.bones if face.type == "ARMATURE" else face.data.shape_keys.key_blocks).keys()
    )


def face_of_rig(rig: bpy.types.Object) -> bpy.types.Object | None:
    """Return the rig if its bones move its face, and no shape keys of its meshes with names that
    are known.
    """
    from ...scene.rigs.face_bones import only_bones_move
    from ...scene.rigs.face_retarget import faces_of
    from ...scene.rigs.rig_file import with_meshes

    if not bones_move(rig):
        return None
    return (
        rig if only_bones_move(rig, faces_of(with_meshes(rig, bpy.context.scene.objects))) else None
    )


def guessed_map(face: bpy.types.Object) -> ExpressionMap:
    """Return the map that the names of a face's shape keys or bones suggest."""
    from ...retarget.expression_map import guess_expression_map
    from ...scene.rigs.face_bones import guess_face_bones
    from ...scene.rigs.face_retarget import key_names

    return guess_face_bones(face) if bones_move(face) else guess_expression_map(key_names([face]))


def listed_or_guessed(settings: bpy.types.PropertyGroup) -> ExpressionMap:
    """Return the list as a map or, if it is empty, the map that the names of the chosen face
    suggest.
    """
    return listed_expressions(settings) if len(settings.face_pairs) else guessed_map(settings.face)


def fill_expressions(settings: bpy.types.PropertyGroup, expression_map: ExpressionMap) -> None:
    """Fill the list with a map, one entry for each expression of a shape key or of a control's
    channel.
    """
    settings.face_pairs.clear()
    entries = [(key, SHAPE_KEY, factors) for key, factors in expression_map.keys.items()]
    entries += [
        (bone, channel, factors)
        for bone, channels in expression_map.controls.items()
        for channel, factors in channels.items()
    ]
    for key, channel, factors in entries:
        for expression, factor in factors.items():
            pair = settings.face_pairs.add()
            pair.key = key
            pair.channel = channel
            pair.expression = expression
            pair.factor = factor
    settings.face_active = 0


def listed_expressions(settings: bpy.types.PropertyGroup) -> ExpressionMap:
    """Return the list as a map; entries without a shape key or control, or without an expression,
    are left out.
    """
    from ...retarget.expression_map import ExpressionMap

    out = ExpressionMap({})
    for pair in settings.face_pairs:
        if not pair.key or not pair.expression:
            continue
        if pair.channel == SHAPE_KEY:
            factors = out.keys.setdefault(pair.key, {})
        else:
            factors = out.controls.setdefault(pair.key, {}).setdefault(pair.channel, {})
        factors[pair.expression] = round(pair.factor, 6)
    return out
