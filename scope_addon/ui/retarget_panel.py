# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel for retargeting a captured motion, and below it that for captured expressions,
and their settings, stored with the scene: the rig and the bone map, the face and the expression
map.
"""

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
from bpy.types import Context, Object, Panel, PropertyGroup, UILayout, UIList

from ..scene.datablocks import is_person
from .capture_panel import PersonTab, Tab
from .captured_person import draw_active_person
from .retarget_operators import (
    SHAPE_KEY,
    bones_move,
    common_prefix,
    face_of_rig,
    fill_expressions,
    guess_into_list,
    guessed_map,
    has_targets,
    targets_of,
)
from .translations import CONTEXT


class SCOPE_UL_bone_pairs(UIList):
    """Bones of the rig and the body parts that they follow."""

    def draw_item(
        self,
        _context: Context,
        layout: UILayout,
        settings: PropertyGroup,
        item: PropertyGroup,
        _icon: int,
        _settings_with_active: PropertyGroup,
        _active_property: str,
    ) -> None:
        """Draw one entry: part, bone, and a question mark if the guess is uncertain.

        Labels leave room for long names; the chosen entry is edited below the list. Blender's
        further arguments, ``index`` and ``flt_flag``, are optional and left out.
        """
        rig = settings.rig
        known = rig is not None and item.bone in rig.data.bones
        row = layout.split(factor=0.4, align=True)
        row.label(text=item.part, translate=False)
        row = row.row(align=True)
        row.alert = not known
        prefix = common_prefix([pair.bone for pair in settings.pairs if pair.bone])
        row.label(text=item.bone.removeprefix(prefix), translate=False)
        if not known or item.confidence <= 0.6:  # certain guesses need no icon
            row.label(text="", icon="QUESTION" if known else "ERROR")


class SCOPE_PT_retarget(PersonTab, Panel):
    """Retargeting of the captured motion to the user's rig."""

    bl_idname = "SCOPE_PT_retarget"
    bl_label = "Retarget"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """Draw the panel."""
        layout = self.layout
        settings = context.scene.scope_retarget
        draw_active_person(layout, context)
        layout.prop(settings, "rig")
        if settings.rig is None:
            return
        for pair in _draw_map(layout, settings, "bone", "pairs", "active"):
            column = layout.column(align=True)
            column.prop(pair, "part", text="", placeholder="Body Part", icon="ARMATURE_DATA")
            column.alert = pair.bone not in settings.rig.data.bones
            column.prop_search(pair, "bone", settings.rig.data, "bones", text="")
        layout.prop(settings, "feet")
        layout.prop(settings, "travel")
        column = layout.column()
        column.label(text="Root Motion")
        column.row(align=True).prop(settings, "root", expand=True)
        column.label(text="Captured Body")
        column.row(align=True).prop(settings, "captured", expand=True)
        layout.operator("scope.retarget", icon="ARMATURE_DATA")


class SCOPE_UL_expression_pairs(UIList):
    """Shape keys or controls of the face and the expressions that they follow."""

    def draw_item(
        self,
        _context: Context,
        layout: UILayout,
        settings: PropertyGroup,
        item: PropertyGroup,
        _icon: int,
        _settings_with_active: PropertyGroup,
        _active_property: str,
    ) -> None:
        """Draw one entry: expression, and shape key or control with its channel; see
        `SCOPE_UL_bone_pairs`.
        """
        from ..kinematics.face import EXPRESSIONS

        known = _is_known(settings.face, item)
        split = layout.split(factor=0.5, align=True)
        row = split.row(align=True)
        row.alert = item.expression not in EXPRESSIONS
        row.label(text=item.expression, translate=False)
        row = split.row(align=True)
        row.alert = not known
        row.label(text=item.key, translate=False)
        if item.channel != SHAPE_KEY:
            row.label(
                text=item.bl_rna.properties["channel"].enum_items[item.channel].name,
                text_ctxt=CONTEXT,
            )
        if not known:
            row.label(text="", icon="ERROR")


class SCOPE_PT_retarget_face(Tab, Panel):
    """Retargeting of captured expressions to shape keys of the user's mesh, or to the bones of a
    rig's face.
    """

    bl_idname = "SCOPE_PT_retarget_face"
    bl_parent_id = "SCOPE_PT_retarget"
    bl_label = "Face"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """Draw the panel."""
        layout = self.layout
        settings = context.scene.scope_retarget
        layout.prop(settings, "face")
        if not has_targets(settings.face):
            return
        for pair in _draw_map(layout, settings, "expression", "face_pairs", "face_active"):
            column = layout.column(align=True)
            column.prop(pair, "expression", text="", placeholder="Expression", icon="SHAPEKEY_DATA")
            column.alert = not _is_known(settings.face, pair)
            if settings.face.type == "ARMATURE":
                column.prop_search(pair, "key", settings.face.data, "bones", text="")
                column.prop(pair, "channel", text="")
            else:
                column.prop_search(
                    pair, "key", settings.face.data.shape_keys, "key_blocks", text=""
                )
            column.alert = False
            column.prop(pair, "factor")
        layout.operator("scope.retarget_face", icon="SHAPEKEY_DATA")


def _draw_map(
    layout: UILayout, settings: PropertyGroup, kind: str, entries: str, active: str
) -> list[PropertyGroup]:
    """Draw the buttons and the list of a map; return its active entry alone, if there is one.

    :param kind: ``bone`` or ``expression``, as in the names of operators and lists.
    :param entries, active: properties of the settings.
    """
    row = layout.row(align=True)
    row.operator(f"scope.guess_{kind}s", icon="VIEWZOOM")
    row.operator(f"scope.load_{kind}_map", text="", icon="FILE_FOLDER")
    row.operator(f"scope.save_{kind}_map", text="", icon="FILE_TICK")
    row.operator(f"scope.edit_{kind}_pair", text="", icon="ADD").action = "ADD"
    row = row.row(align=True)
    listed = getattr(settings, entries)
    row.enabled = len(listed) > 0
    row.operator(f"scope.edit_{kind}_pair", text="", icon="REMOVE").action = "REMOVE"
    layout.template_list(f"SCOPE_UL_{kind}_pairs", "", settings, entries, settings, active, rows=5)
    chosen: int = getattr(settings, active)
    return list(listed[chosen : chosen + 1])


def _is_known(face: Object | None, pair: PropertyGroup) -> bool:
    """Return whether the chosen face has the shape key or the control of an entry."""
    if (
        face is None
        or not has_targets(face)
        or (face.type == "ARMATURE") == (pair.channel == SHAPE_KEY)
    ):
        return False
    return pair.key in targets_of(face)


def offered_parts(_pair: PropertyGroup | None, _context: Context, typed: str) -> list[str]:
    """Return the body parts whose names contain what was typed so far, for Blender to suggest."""
    from ..retarget.bone_map import PARTS

    return [part for part in PARTS if typed.lower() in part]


class SCOPE_PG_bone_pair(PropertyGroup):
    """One bone of the user's rig and the body part that it follows."""

    bone: StringProperty(name="Bone", description="Bone of your rig")
    part: StringProperty(
        name="Body Part",
        search=offered_parts,
        description="Part of the captured body that this bone follows",
    )
    confidence: FloatProperty(
        name="Confidence", min=0.0, max=1.0, description="Confidence of the guess"
    )


def offered_expressions(_pair: PropertyGroup | None, _context: Context, typed: str) -> list[str]:
    """Return the expressions whose names contain what was typed so far, for Blender to suggest."""
    from ..kinematics.face import EXPRESSIONS

    return [name for name in EXPRESSIONS if typed.lower() in name.lower()]


class SCOPE_PG_expression_pair(PropertyGroup):
    """One shape key of the user's mesh, or channel of a rig's control, and an expression that it
    follows.
    """

    key: StringProperty(
        name="Shape Key or Control",
        description="Shape key of your mesh, or bone of your rig's face",
    )
    channel: EnumProperty(
        name="Channel",
        items=(
            ("key", "Shape Key", "Value of a shape key", 0),
            (
                "left",
                "Left",
                "Moves to the person's left, relative to mouth width, eye distance or lid gap",
                1,
            ),
            ("up", "Up", "Moves up, relative to mouth width, eye distance or lid gap", 2),
            (
                "forward",
                "Forward",
                "Moves forward, relative to mouth width, eye distance or lid gap",
                3,
            ),
            ("pitch", "Pitch", "Turns down, in degrees", 4),
            ("yaw", "Yaw", "Turns to the person's left, in degrees", 5),
            ("roll", "Roll", "Turns with the left side up, in degrees", 6),
        ),
        default="key",
        translation_context=CONTEXT,
        description="How a control follows the expression, along the axes of the rig's face",
    )
    expression: StringProperty(
        name="Expression",
        search=offered_expressions,
        description="Captured expression that this entry follows",
    )
    factor: FloatProperty(
        name="Factor",
        default=1.0,
        min=-180.0,
        max=180.0,
        soft_min=-10.0,
        soft_max=10.0,
        description="Value where the expression is 1: at most 10, or 180 degrees; several "
        "expressions add up",
    )


def _is_face(_settings: PropertyGroup, obj: Object) -> bool:
    captured = obj.parent is not None and is_person(obj.parent)
    return not captured and has_targets(obj)


def _is_armature(_settings: PropertyGroup, obj: Object) -> bool:
    return obj.type == "ARMATURE" and not is_person(obj)


def _list_bones_of_new_rig(settings: PropertyGroup, _context: Context) -> None:
    """Replace the bone list of another rig by a guess; keep that of the same rig, or of one with
    the same bones.

    A rig whose bones move its face becomes the face as well, unless another one is chosen.
    """
    rig = settings.rig
    if rig is None:
        return

    if settings.face is None or bones_move(settings.face):
        settings.face = face_of_rig(rig)
    bones = "\n".join(sorted(rig.data.bones.keys()))
    if settings.listed_bones == bones:
        return
    settings.listed_bones = bones
    if len(settings.pairs) == 0:
        return  # nothing to replace: guessed when it is needed

    guess_into_list(settings)


def _list_keys_of_new_face(settings: PropertyGroup, _context: Context) -> None:
    """Replace the expression list of another face by a guess; keep that of one with the same shape
    keys or bones.
    """
    if not has_targets(settings.face):
        return
    keys = "\n".join(sorted(targets_of(settings.face).keys()))
    if settings.listed_keys == keys:
        return
    settings.listed_keys = keys
    if len(settings.face_pairs) == 0:
        return  # nothing to replace: guessed when it is needed
    fill_expressions(settings, guessed_map(settings.face))


class SCOPE_PG_retarget(PropertyGroup):
    """The settings of retargeting."""

    rig: PointerProperty(
        name="Rig",
        type=Object,
        poll=_is_armature,
        update=_list_bones_of_new_rig,
        description="Armature to animate with the captured motion",
    )
    # names of all bones of the rig that the list is for
    listed_bones: StringProperty(options={"HIDDEN"})
    pairs: CollectionProperty(type=SCOPE_PG_bone_pair)
    active: IntProperty()
    face: PointerProperty(
        name="Face",
        type=Object,
        poll=_is_face,
        update=_list_keys_of_new_face,
        description="Mesh with shape keys, or rig whose bones move its face, to animate with the "
        "captured expressions",
    )
    # names of all shape keys or bones that the list is for
    listed_keys: StringProperty(options={"HIDDEN"})
    face_pairs: CollectionProperty(type=SCOPE_PG_expression_pair)
    face_active: IntProperty()
    feet: BoolProperty(
        name="Feet on the Floor",
        default=True,
        description="Lock feet that are in contact, scaled to the rig, and keep them above the "
        "floor",
    )
    travel: FloatProperty(
        name="Travel Scale",
        default=0.0,
        min=0.0,
        soft_max=10.0,
        precision=3,
        description="Scale of positions on the floor. 0: the ratio of leg lengths, so that steps "
        "fit the rig. Several "
        "people who touch or meet need the same value for all their rigs",
    )
    root: EnumProperty(
        name="Root Motion",
        items=(
            ("bone", "In Bones", "The pelvis moves through the scene", 0),
            (
                "object",
                "On Object",
                "An empty carries position and heading, the rig moves relative to it",
                1,
            ),
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
        # Blender's own translations are too long for three buttons in a row
        translation_context=CONTEXT,
        description="How the captured person is shown after retargeting",
    )


def attach() -> None:
    """Add the settings to every scene."""
    bpy.types.Scene.scope_retarget = PointerProperty(type=SCOPE_PG_retarget)


def detach() -> None:
    """Remove the settings."""
    del bpy.types.Scene.scope_retarget


CLASSES = (
    SCOPE_UL_bone_pairs,
    SCOPE_PT_retarget,
    SCOPE_UL_expression_pairs,
    SCOPE_PT_retarget_face,
    SCOPE_PG_bone_pair,
    SCOPE_PG_expression_pair,
    SCOPE_PG_retarget,
)
