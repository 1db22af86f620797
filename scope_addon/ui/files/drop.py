# SPDX-License-Identifier: GPL-3.0-or-later
"""Footage and motion files dropped from the system's file browser into the 3D viewport."""

from __future__ import annotations

import bpy

from ...footage import FOOTAGE_SUFFIXES


class SCOPE_FH_footage(bpy.types.FileHandler):
    """Make a dropped video or image the scene's footage."""

    bl_idname = "SCOPE_FH_footage"
    bl_label = "Capture with Scope"
    bl_import_operator = "scope.choose_footage"
    bl_file_extensions = ";".join(FOOTAGE_SUFFIXES)

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        """Accept files over a 3D viewport, where the panel is."""
        return bool(context.area) and context.area.type == "VIEW_3D"


class SCOPE_FH_motion(bpy.types.FileHandler):
    """Import dropped motion files."""

    bl_idname = "SCOPE_FH_motion"
    bl_label = "Import Motion with Scope"
    bl_import_operator = "scope.import_motion"
    bl_file_extensions = ".npz"

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        """Accept files over a 3D viewport."""
        return bool(context.area) and context.area.type == "VIEW_3D"


CLASSES = (SCOPE_FH_footage, SCOPE_FH_motion)
