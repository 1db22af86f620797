# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel for correcting a captured motion."""

from __future__ import annotations

import bpy

from ..scene.character.correction_list import listed_corrections
from .capture_panel import PersonTab
from .captured_person import captured_armature
from .pin_tool import is_running

_ICONS = {
    "PIN": "PINNED",
    "CONTACT": "SNAP_FACE",
    "EXCHANGE": "MOD_MIRROR",
    "FLIP": "ARROW_LEFTRIGHT",
    "UPRIGHT": "EMPTY_SINGLE_ARROW",
    "FLOOR": "GRID",
    "INTERPOLATION": "IPO_EASE_IN_OUT",
    "FEET": "TRIA_DOWN_BAR",
}


class SCOPE_PT_corrections(PersonTab, bpy.types.Panel):
    """Pins, feet that stand, exchanged sides, kept edits, the upright line and the floor of the
    selected person.
    """

    bl_idname = "SCOPE_PT_corrections"
    bl_label = "Corrections"
    bl_parent_id = "SCOPE_PT_edit"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the panel."""
        layout = self.layout
        armature = captured_armature(context)
        if armature is None:
            return
        layout.operator("scope.pin_limb", icon="PINNED", depress=is_running())
        draw_corrections(layout, layout.row(align=True))
        listed = listed_corrections(armature)
        if not listed:
            return
        column = layout.box().column(align=True)
        for index, entry in enumerate(listed):
            row = column.row(align=True)
            span = (
                str(entry["first"])
                if entry["first"] == entry["last"]
                else f"{entry['first']}–{entry['last']}"
            )
            cells = row.split(factor=0.68, align=True)
            cells.label(
                text=entry["text"],
                icon="ERROR" if entry["missed"] else _ICONS.get(entry["kind"], "DOT"),
            )
            cells.operator("scope.go_to_frame", text=span).frame = entry["first"]
            row.operator("scope.remove_correction", text="", icon="X", emboss=False).index = index
        if len(listed) > 1:
            column.operator("scope.remove_correction", text="Remove All").index = -1


def draw_corrections(layout: bpy.types.UILayout, feet: bpy.types.UILayout) -> None:
    """Draw the buttons that add corrections, in the panel or a menu.

    :param feet: where both feet's buttons are.
    """
    for text, foot in (("Left Foot Stands", "left"), ("Right Foot Stands", "right")):
        feet.operator("scope.foot_stands", text=text).foot = foot
    layout.operator("scope.exchange_sides", icon="MOD_MIRROR")
    layout.operator("scope.upright_line", icon="EMPTY_SINGLE_ARROW")
    layout.operator("scope.floor_here", icon="GRID")
    layout.operator("scope.this_rests", icon="SNAP_FACE")
    layout.operator("scope.flip_limb", icon="ARROW_LEFTRIGHT")
    layout.operator("scope.turn_around", icon="FILE_REFRESH")


CLASSES = (SCOPE_PT_corrections,)
