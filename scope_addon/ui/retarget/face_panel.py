# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel for retargeting captured expressions, below that for bones."""

from __future__ import annotations

import bpy

from ..capture.capture_panel import Tab
from ..translations import CONTEXT
from .face_list import SHAPE_KEY, has_targets


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
        from ...expression_names import EXPRESSIONS

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
        row = layout.row(align=True)
        row.operator("scope.guess_expressions", icon="VIEWZOOM")
        row.operator("scope.load_expression_map", text="", icon="FILE_FOLDER")
        row.operator("scope.save_expression_map", text="", icon="FILE_TICK")
        row.operator("scope.edit_expression_pair", text="", icon="ADD").action = "ADD"
        row = row.row(align=True)
        row.enabled = len(settings.face_pairs) > 0
        row.operator("scope.edit_expression_pair", text="", icon="REMOVE").action = "REMOVE"
        layout.template_list(
            "SCOPE_UL_expression_pairs", "", settings, "face_pairs", settings, "face_active", rows=5
        )
        for pair in settings.face_pairs[settings.face_active : settings.face_active + 1]:
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


CLASSES = (SCOPE_UL_expression_pairs, SCOPE_PT_retarget_face)
