# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel for editing a captured motion."""

from __future__ import annotations

import bpy

from .capture.capture_panel import Tab
from .capture.captures import people_of, shown_capture
from .captured_person import draw_active_person, has_captured_person
from .translations import CONTEXT


class SCOPE_PT_edit(Tab, bpy.types.Panel):
    """Smoothing, repairs, floor, root motion, loops and keys of the selected person."""

    bl_idname = "SCOPE_PT_edit"
    bl_label = "Refine"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require a captured person."""
        return has_captured_person(context)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the panel."""
        layout = self.layout
        if draw_active_person(layout, context) is None:
            return
        settings = context.scene.scope
        row = layout.row(align=True)
        for text, strength in (("Raw", 0.0), ("Normal", 1.0), ("Strong", 2.5)):
            smooth = row.operator("scope.smooth", text=text)
            smooth.strength = strength
            smooth.everyone = settings.smooth_everyone
        shown = shown_capture(context.scene)
        if shown is not None and len(people_of(shown)) > 1:
            layout.prop(settings, "smooth_everyone")
        column = layout.column(align=True)
        column.operator("scope.interpolate_span", icon="IPO_EASE_IN_OUT")
        column.operator("scope.refloor", icon="TRIA_DOWN_BAR")
        layout.label(text="Root Motion")
        row = layout.row(align=True)
        for text, mode in (
            ("In Bones", "BONES"),
            ("On Object", "OBJECT"),
            ("In Place", "IN_PLACE"),
        ):
            row.operator("scope.root_motion", text=text).mode = mode
        layout.label(text="Keys", text_ctxt=CONTEXT)
        column = layout.column(align=True)
        column.operator("scope.loop", icon="FILE_REFRESH")
        column.operator("scope.reduce_keys", icon="KEY_DEHLT")
        column.operator("scope.bake_rate", icon="KEYFRAME_HLT")


CLASSES = (SCOPE_PT_edit,)
