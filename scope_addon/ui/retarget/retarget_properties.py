# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of retargeting: the rig and the bone map, the face and the expression map. Stored with the scene."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..translations import CONTEXT


def offered_parts(_pair: bpy.types.PropertyGroup | None, _context: bpy.types.Context, typed: str) -> list[str]:
    """Return the body parts whose names contain what was typed so far, for Blender to suggest."""
    from ...retarget.bone_map import PARTS

    return [part for part in PARTS if typed.lower() in part]


class SCOPE_PG_bone_pair(bpy.types.PropertyGroup):
    """One bone of the user's rig and the body part that it follows."""

    bone: StringProperty(name="Bone", description="Bone of your rig")
    part: StringProperty(
        name="Body Part", search=offered_parts, description="Part of the captured body that this bone follows"
    )
    confidence: FloatProperty(name="Confidence", min=0.0, max=1.0, description="Confidence of the guess")


def offered_expressions(_pair: bpy.types.PropertyGroup | None, _context: bpy.types.Context, typed: str) -> list[str]:
    """Return the expressions whose names contain what was typed so far, for Blender to suggest."""
    from ....solver.names import EXPRESSIONS

    return [name for name in EXPRESSIONS if typed.lower() in name.lower()]


class SCOPE_PG_expression_pair(bpy.types.PropertyGroup):
    """One shape key of the user's mesh and an expression that it follows."""

    key: StringProperty(name="Shape Key", description="Shape key of your mesh")
    expression: StringProperty(
        name="Expression", search=offered_expressions, description="Captured expression that this shape key follows"
    )
    factor: FloatProperty(
        name="Factor",
        default=1.0,
        min=-10.0,
        max=10.0,
        description="Value of the shape key where the expression is 1; several expressions of a key add up",
    )


def _is_face(_settings: bpy.types.PropertyGroup, obj: bpy.types.Object) -> bool:
    captured = obj.parent is not None and "scope_source" in obj.parent
    return obj.type == "MESH" and obj.data.shape_keys is not None and not captured


def _is_armature(_settings: bpy.types.PropertyGroup, obj: bpy.types.Object) -> bool:
    return obj.type == "ARMATURE" and "scope_source" not in obj


def _list_bones_of_new_rig(settings: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """Replace the bone list of another rig by a guess; keep that of the same rig, or of one with the same bones."""
    rig = settings.rig
    if rig is None:
        return
    bones = "\n".join(sorted(bone.name for bone in rig.data.bones))
    if settings.listed_bones == bones:
        return
    settings.listed_bones = bones
    if len(settings.pairs) == 0:
        return  # nothing to replace: guessed when it is needed
    from .bone_list import guess_into_list

    guess_into_list(settings)


def _list_keys_of_new_face(settings: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """Replace the expression list of another mesh by a guess; keep that of a mesh with the same keys."""
    if settings.face is None or settings.face.data.shape_keys is None:
        return
    keys = "\n".join(sorted(block.name for block in settings.face.data.shape_keys.key_blocks))
    if settings.listed_keys == keys:
        return
    settings.listed_keys = keys
    if len(settings.face_pairs) == 0:
        return  # nothing to replace: guessed when it is needed
    from .face_operators import fill_expressions, guessed_map

    fill_expressions(settings, guessed_map(settings.face))


class SCOPE_PG_retarget(bpy.types.PropertyGroup):
    """The settings of retargeting."""

    rig: PointerProperty(
        name="Rig",
        type=bpy.types.Object,
        poll=_is_armature,
        update=_list_bones_of_new_rig,
        description="Armature to animate with the captured motion",
    )
    listed_bones: StringProperty(options={"HIDDEN"})  # names of all bones of the rig that the list is for
    pairs: CollectionProperty(type=SCOPE_PG_bone_pair)
    active: IntProperty()
    face: PointerProperty(
        name="Mesh",
        type=bpy.types.Object,
        poll=_is_face,
        update=_list_keys_of_new_face,
        description="Mesh with shape keys to animate with the captured expressions",
    )
    listed_keys: StringProperty(options={"HIDDEN"})  # names of all shape keys of the mesh that the list is for
    face_pairs: CollectionProperty(type=SCOPE_PG_expression_pair)
    face_active: IntProperty()
    feet: BoolProperty(
        name="Feet on the Floor",
        default=True,
        description="Lock feet that are in contact, scaled to the rig, and keep them above the floor",
    )
    root: EnumProperty(
        name="Root Motion",
        items=(
            ("bone", "In Bones", "The pelvis moves through the scene", 0),
            ("object", "On Object", "An empty carries position and heading, the rig moves relative to it", 1),
            ("in-place", "In Place", "No root motion: the character stays in place", 2),
        ),
        default="bone",
        description="Where the root motion of the rig is stored",
    )
    captured: EnumProperty(
        name="Captured Body",
        items=(
            ("hide", "Hide", "Hide the captured person, except when comparing with the footage", 0),
            ("beside", "Side by Side", "Show both, the rig to the left of the captured person", 1),
            ("keep", "Overlap", "Show both in the same place", 2),
        ),
        default="hide",
        translation_context=CONTEXT,  # Blender's own translations are too long for three buttons in a row
        description="How the captured person is shown after retargeting",
    )


CLASSES = (SCOPE_PG_bone_pair, SCOPE_PG_expression_pair, SCOPE_PG_retarget)


def attach() -> None:
    """Add the settings to every scene."""
    bpy.types.Scene.scope_retarget = PointerProperty(type=SCOPE_PG_retarget)


def detach() -> None:
    """Remove the settings."""
    del bpy.types.Scene.scope_retarget
