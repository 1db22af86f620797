# SPDX-License-Identifier: GPL-3.0-or-later
"""The retarget section of the sidebar."""

from __future__ import annotations

import bpy

from ..capture.capture_panel import Tab
from ..captured_person import draw_active_person, has_captured_person


class SCOPE_UL_bone_pairs(bpy.types.UIList):
    """Bones of the rig and the body parts that they follow."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index) -> None:  # type: ignore[no-untyped-def]
        """One line: part, bone, and a question mark where the guess is not sure."""
        rig = data.rig
        chosen = index == getattr(active_data, active_property)
        row = layout.split(factor=0.5 if chosen else 0.42, align=True)
        if chosen or not item.part:
            row.prop(item, "part", text="", placeholder="Body Part")
        else:  # without the field's frame and button the longest names fit
            row.label(text=item.part)
        row = row.row(align=True)
        known = rig is not None and item.bone in rig.data.bones
        row.alert = not known
        if rig is not None:
            row.prop_search(item, "bone", rig.data, "bones", text="")
        if not known or item.confidence <= 0.6:  # no room is wasted on what is sure
            row.label(text="", icon="QUESTION" if known else "ERROR")


class SCOPE_PT_retarget(Tab, bpy.types.Panel):
    """Put the captured motion on a rig of your own."""

    bl_idname = "SCOPE_PT_retarget"
    bl_label = "Retarget"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """There is a captured person."""
        return has_captured_person(context)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the panel."""
        layout, settings = self.layout, context.scene.scope_retarget
        draw_active_person(layout, context)
        layout.prop(settings, "rig")
        if settings.rig is None:
            return
        row = layout.row(align=True)
        row.operator("scope.guess_bones", icon="VIEWZOOM")
        row.operator("scope.load_bone_map", text="", icon="FILE_FOLDER")
        row.operator("scope.save_bone_map", text="", icon="FILE_TICK")
        row = layout.row()
        row.template_list("SCOPE_UL_bone_pairs", "", settings, "pairs", settings, "active", rows=6)
        column = row.column(align=True)
        column.operator("scope.edit_bone_pair", text="", icon="ADD").action = "ADD"
        column.operator("scope.edit_bone_pair", text="", icon="REMOVE").action = "REMOVE"
        layout.prop(settings, "feet")
        column = layout.column()
        column.label(text="Root Motion")
        column.row(align=True).prop(settings, "root", expand=True)
        column.label(text="Captured Body")
        column.row(align=True).prop(settings, "captured", expand=True)
        layout.operator("scope.retarget", icon="ARMATURE_DATA")


CLASSES = (SCOPE_UL_bone_pairs, SCOPE_PT_retarget)
