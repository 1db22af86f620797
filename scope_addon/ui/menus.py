# SPDX-License-Identifier: GPL-3.0-or-later
"""Entries in Blender's own menus; its search (key F3) finds operators by the menus that lead to
them.
"""

from __future__ import annotations

import bpy
from bpy.types import Context, Menu, UILayout

from .captured_person import captured_armature
from .edit_panel import draw_corrections
from .export_operators import FORMATS, is_available
from .reporting import iface_


class SCOPE_MT_export(Menu):
    """Formats of captured motion"""

    bl_idname = "SCOPE_MT_export"
    bl_label = "Captured Motion (Mocap)"

    def draw(self, context: Context) -> None:
        """Draw the menu."""
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"
        for key, label, _, _ in FORMATS:
            row = layout.row()
            row.enabled = is_available(key)
            text = iface_(
                "Captured Motion as {format} (.{suffix})", format=label, suffix=key.lower()
            )
            row.operator("scope.export", text=text).format = key


class SCOPE_MT_motion_capture(Menu):
    """Capture motion from video, and view, edit, retarget and export captured motion"""

    bl_idname = "SCOPE_MT_motion_capture"
    bl_label = "Motion Capture"

    def draw(self, context: Context) -> None:
        """Draw the menu."""
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"
        draw_import_video(layout, "FILE_MOVIE")
        layout.operator("scope.look_through", icon="VIEW_CAMERA")
        layout.operator("scope.footage_to_sequencer", icon="SEQUENCE")
        layout.operator("scope.match_frame_rate", icon="TIME")
        layout.separator()
        for name in ("smooth", "interpolate_span", "refloor", "loop", "reduce_keys", "bake_rate"):
            layout.operator(f"scope.{name}")
        layout.operator_menu_enum("scope.root_motion", "mode")
        layout.separator()
        layout.operator("scope.pin_limb", icon="PINNED")
        draw_corrections(layout, layout)
        layout.separator()
        layout.operator("scope.retarget", text="Retarget to Rig", icon="ARMATURE_DATA")
        layout.operator("scope.rename_take", icon="GREASEPENCIL")
        layout.operator("scope.delete_capture", icon="TRASH")
        layout.operator("scope.push_to_nla", icon="NLA_PUSHDOWN")
        layout.operator("scope.mark_asset", icon="ASSET_MANAGER")
        layout.menu(SCOPE_MT_export.bl_idname, text="Export", icon="EXPORT")


def draw_import_video(layout: UILayout, icon: str) -> None:
    """Draw the entry with the words people search for: its own count more than those of the menus
    that lead to it.
    """
    layout.operator(
        "scope.import_video", text="Motion from Video (Motion Capture, Mocap)", icon=icon
    )


def _draw_import_motion(self: Menu, _context: Context) -> None:
    self.layout.operator("scope.import_motion", text="Scope, SMPL or BVH Motion")


def _draw_import(self: Menu, _context: Context) -> None:
    draw_import_video(self.layout, "NONE")


def _draw_export(self: Menu, _context: Context) -> None:
    self.layout.menu(SCOPE_MT_export.bl_idname)


def _draw_motion_capture(self: Menu, _context: Context) -> None:
    self.layout.separator()
    self.layout.menu(SCOPE_MT_motion_capture.bl_idname)


def _draw_pin_limb(self: Menu, context: Context) -> None:
    if captured_armature(context) is not None:
        self.layout.separator()
        self.layout.operator("scope.pin_limb", icon="PINNED")


_ENTRIES = (
    ("TOPBAR_MT_file_import", _draw_import_motion),
    ("TOPBAR_MT_file_import", _draw_import),
    ("TOPBAR_MT_file_export", _draw_export),
    ("VIEW3D_MT_object", _draw_motion_capture),
    ("VIEW3D_MT_pose", _draw_pin_limb),
    ("VIEW3D_MT_pose", _draw_motion_capture),
)


def attach() -> None:
    """Add the entries."""
    for menu, draw in _ENTRIES:
        getattr(bpy.types, menu).append(draw)


def detach() -> None:
    """Remove the entries."""
    for menu, draw in _ENTRIES:
        getattr(bpy.types, menu).remove(draw)


CLASSES = (SCOPE_MT_export, SCOPE_MT_motion_capture)
