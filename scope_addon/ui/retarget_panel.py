# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel for retargeting a captured motion, and below it that for captured expressions."""

from __future__ import annotations

import bpy

from .capture.capture_panel import Tab
from .captured_person import draw_active_person, has_captured_person
from .retarget_maps import SHAPE_KEY, common_prefix, has_targets
from .translations import CONTEXT


class SCOPE_UL_bone_pairs(bpy.types.UIList):
    """Bones of the rig and the body parts that they follow."""

    def draw_item(
        self,
        _context: bpy.types.Context,
        layout: bpy.types.UILayout,
        settings: bpy.types.PropertyGroup,
        item: bpy.types.PropertyGroup,
        _icon: int,
        _settings_with_active: bpy.types.PropertyGroup,
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


class SCOPE_PT_retarget(Tab, bpy.types.Panel):
    """Retargeting of the captured motion to the user's rig."""

    bl_idname = "SCOPE_PT_retarget"
    bl_label = "Retarget"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require a captured person."""
        return has_captured_person(context)

    def draw(self, context: bpy.types.Context) -> None:
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


class SCOPE_UL_expression_pairs(bpy.types.UIList):
    """Shape keys or controls of the face and the expressions that they follow."""

    def draw_item(
        self,
        _context: bpy.types.Context,
        layout: bpy.types.UILayout,
        settings: bpy.types.PropertyGroup,
        item: bpy.types.PropertyGroup,
        _icon: int,
        _settings_with_active: bpy.types.PropertyGroup,
        _active_property: str,
    ) -> None:
        """Draw one entry: expression, and shape key or control with its channel; see
        `SCOPE_UL_bone_pairs`.
        """
        from ..expression_names import EXPRESSIONS

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


class SCOPE_PT_retarget_face(Tab, bpy.types.Panel):
    """Retargeting of captured expressions to shape keys of the user's mesh, or to the bones of a
    rig's face.
    """

    bl_idname = "SCOPE_PT_retarget_face"
    bl_parent_id = "SCOPE_PT_retarget"
    bl_label = "Face"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
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
    layout: bpy.types.UILayout,
    settings: bpy.types.PropertyGroup,
    kind: str,
    entries: str,
    active: str,
) -> list[bpy.types.PropertyGroup]:
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


def _is_known(face: bpy.types.Object | None, pair: bpy.types.PropertyGroup) -> bool:
    """Return whether the chosen face has the shape key or the control of an entry."""
    if (
        face is None
        or not has_targets(face)
        or (face.type == "ARMATURE") == (pair.channel == SHAPE_KEY)
    ):
        return False
    return pair.key in (
        face.data.bones if face.type == "ARMATURE" else face.data.shape_keys.key_blocks
    )


CLASSES = (
    SCOPE_UL_bone_pairs,
    SCOPE_PT_retarget,
    SCOPE_UL_expression_pairs,
    SCOPE_PT_retarget_face,
)
