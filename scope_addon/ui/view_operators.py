# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking at the result."""

from __future__ import annotations

import bpy


class SCOPE_OT_look_through(bpy.types.Operator):
    """Look through the capture's camera, the footage behind the body. Gives the scene the footage's resolution"""

    bl_idname = "scope.look_through"
    bl_label = "Compare with Footage"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """The last capture has a camera."""
        return camera_of(context.scene) is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set the scene's camera and resolution, and the viewport's view."""
        scene, camera = context.scene, camera_of(context.scene)
        scene.camera = camera
        render, result = scene.render, scene.scope.result
        render.resolution_x, render.resolution_y = result.resolution
        render.pixel_aspect_x, render.pixel_aspect_y = result.pixel_aspect
        render.resolution_percentage = 100
        for area in context.screen.areas if context.screen else ():
            if area.type == "VIEW_3D":
                area.spaces.active.region_3d.view_perspective = "CAMERA"
        return {"FINISHED"}


def camera_of(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The camera of the scene's last capture."""
    collection = scene.scope.result.collection
    return next((o for o in collection.all_objects if o.type == "CAMERA"), None) if collection else None


CLASSES = (SCOPE_OT_look_through,)
