# SPDX-License-Identifier: GPL-3.0-or-later
"""A window that shows another scene for a moment."""

import bpy
from scope.scope_addon.scene.export.export_states import temporary_scene


def test_viewports_look_through_the_camera_after_an_export_too():
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    areas = bpy.context.window_manager.windows[0].screen.areas
    space = next(area for area in areas if area.type == "VIEW_3D").spaces.active
    space.region_3d.view_perspective = "CAMERA"
    with temporary_scene("Capture"):  # without a camera, as of a rig
        assert space.region_3d.view_perspective != "CAMERA"
    assert space.region_3d.view_perspective == "CAMERA"
    assert space.camera == camera
