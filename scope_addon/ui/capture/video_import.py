# SPDX-License-Identifier: GPL-3.0-or-later
"""Capturing from the menu File > Import: choosing the footage and capturing it in one step."""

from __future__ import annotations

import os
from pathlib import Path

import bpy

from ..file_field import FootageBrowser, stored_path
from ..reporting import rpt_
from ..sidebar import show_tab
from .capture_operators import nothing_runs


class SCOPE_OT_import_video(FootageBrowser, bpy.types.Operator):
    """Motion capture: animate a body with the motion of the person in a video or image"""

    bl_idname = "scope.import_video"
    bl_label = "Motion from Video"  # short: the button of the file browser shows it, too
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require that no capture is running."""
        return nothing_runs(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the file."""
        return self.ask(context)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings of the capture in the sidebar of the file browser."""
        layout = self.layout
        settings = context.scene.scope
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in ("quality", "people", "hands", "face", "height_cm", "take"):
            layout.prop(settings, name)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set the footage to the file, and start the capture."""
        path = Path(bpy.path.abspath(self.filepath))
        if not os.path.isfile(path):  # Path.is_file raises where a name is too long
            self.report({"ERROR"}, rpt_("{path} is not a file; choose a video or image", path=path))
            return {"CANCELLED"}
        context.scene.scope.footage = stored_path(context, str(path))
        context.scene.scope.views.clear()  # which are of other footage
        show_tab(context)
        try:
            bpy.ops.scope.capture("INVOKE_DEFAULT")
        except RuntimeError as error:  # it has said why nothing can be captured here
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        return {"FINISHED"}


CLASSES = (SCOPE_OT_import_video,)
