# SPDX-License-Identifier: GPL-3.0-or-later
"""The view over the footage and the one from the side, as far as a Blender without a window has
them.
"""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.datablocks import tag_part, view_number
from scope.scope_addon.ui import comparison
from scope.scope_addon.ui.view_operators import show_new_capture
from scope.solver import load_body

from ...made_motion import made_views


def window_and_viewport():
    """Open Blender's own startup file; return its window and 3D viewport."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    window = bpy.context.window_manager.windows[0]
    return window, next(each for each in window.screen.areas if each.type == "VIEW_3D")


@pytest.mark.parametrize("heading", [0.0, 0.7, 3.0])
@pytest.mark.parametrize("tilt", [0.0, -0.5, 0.4])
def test_the_side_view_is_level_and_looks_across_the_cameras_view(heading, tilt):
    camera = Euler((np.pi / 2 + tilt, 0.0, heading)).to_matrix().to_4x4()
    side = np.array(comparison._side_rotation(camera))
    np.testing.assert_allclose(side @ side.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(side) == pytest.approx(1.0)
    looks = -side[:, 2]
    up = side[:, 1]
    np.testing.assert_allclose(up, [0, 0, 1], atol=1e-6)
    forward = -np.array(camera.col[2])[:3]
    assert abs(looks @ forward) < 1e-6
    # to the right of the camera's view
    np.testing.assert_allclose(looks, np.array(camera.col[0])[:3], atol=1e-6)


def test_a_camera_that_looks_along_its_side_still_gives_a_view():
    on_its_side = Matrix.Rotation(np.pi / 2, 4, "Y")  # its x points down
    side = np.array(comparison._side_rotation(on_its_side))
    np.testing.assert_allclose(side @ side.T, np.eye(3), atol=1e-6)


def test_the_side_view_needs_the_view_over_the_footage():
    with pytest.raises(RuntimeError, match="Compare with Footage first"):
        bpy.ops.scope.side_view()


def test_bones_are_hidden_in_the_view_and_shown_again_after_it():
    window, area = window_and_viewport()
    overlay = area.spaces.active.overlay
    collection = bpy.data.collections.new("capture")
    bpy.context.scene.collection.children.link(collection)
    for shown in (True, False):
        overlay.show_bones = shown
        with bpy.context.temp_override(window=window, area=area):
            comparison.begin(bpy.context, area, collection)
            assert not overlay.show_bones
            comparison.end(window, area)
        assert overlay.show_bones is shown


def test_a_capture_is_compared_without_what_is_excluded_from_the_view_layer():
    window, area = window_and_viewport()
    collection, bpy.context.scene.camera = capture_with_camera("capture")
    child = bpy.data.collections.new("props")
    child.objects.link(bpy.data.objects.new("prop", None))
    collection.children.link(child)
    layer = bpy.context.view_layer.layer_collection.children["capture"]
    layer.children["props"].exclude = True
    with bpy.context.temp_override(window=window, area=area):
        comparison.begin(bpy.context, area, collection)
    assert area.spaces.active.local_view
    comparison.end(window, area)


def capture_with_camera(name):
    """Return a capture's collection with a camera, linked to the scene, and the camera."""
    collection = bpy.data.collections.new(name)
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    collection["scope_capture"] = 1
    tag_part(camera)
    collection.objects.link(camera)
    bpy.context.scene.collection.children.link(collection)
    return collection, camera


def test_a_capture_without_people_splits_no_viewport():
    window, area = window_and_viewport()
    scene = bpy.context.scene
    scene.scope.capture, scene.camera = capture_with_camera("capture")
    count = len(window.screen.areas)
    with bpy.context.temp_override(window=window, area=area):
        comparison.open_side_view(bpy.context, area)
    assert len(window.screen.areas) == count


def test_a_new_capture_ends_the_comparison_of_an_earlier_one_and_no_other_view(monkeypatch):
    window, area = window_and_viewport()
    scene = bpy.context.scene
    space = area.spaces.active
    earlier, scene.camera = capture_with_camera("earlier")
    with bpy.context.temp_override(window=window, area=area):
        comparison.begin(bpy.context, area, earlier)
    assert space.local_view
    assert space.region_3d.view_perspective == "CAMERA"
    comparison.end_others(scene, earlier)
    assert space.local_view  # it is the shown capture itself
    scene.scope.capture, _ = capture_with_camera("new")
    side = next(each for each in window.screen.areas if each.type == "OUTLINER")
    closed = []
    monkeypatch.setattr(comparison, "side_area", lambda screen: side)
    monkeypatch.setattr(comparison, "_close_later", closed.append)
    with bpy.context.temp_override(window=window, area=area):
        show_new_capture(bpy.context, scene)
    assert space.local_view is None
    assert space.region_3d.view_perspective != "CAMERA"
    assert space.overlay.show_bones
    assert closed == [side]
    own = bpy.data.objects.new("own", bpy.data.cameras.new("own"))
    scene.collection.objects.link(own)
    space.camera = own
    space.region_3d.view_perspective = "CAMERA"
    with bpy.context.temp_override(window=window, area=area):
        show_new_capture(bpy.context, scene)
    assert space.region_3d.view_perspective == "CAMERA"


def test_the_comparison_switches_between_the_cameras_of_a_capture(standing):
    window, area = window_and_viewport()
    scene = bpy.context.scene
    motion = replace(standing, views=made_views(0.5, -0.2))
    built = build_scene([motion], load_body("scope"), options=BuildOptions())
    scene.scope.capture = built.collection
    space = area.spaces.active
    cameras = comparison.cameras_of(scene)
    assert [view_number(camera) for camera in cameras] == [None, 0, 1]
    assert comparison.camera_of(scene) == built.people[0].camera
    scene.camera = cameras[0]
    with bpy.context.temp_override(window=window, area=area):
        comparison.begin(bpy.context, area, built.collection)
        for index in (2, 0, 1):
            assert bpy.ops.scope.compare_view(index=index) == {"FINISHED"}
            assert scene.camera == space.camera == cameras[index]
            assert comparison.is_looking_through(bpy.context)
            size = scene.render.resolution_x, scene.render.resolution_y
            assert size == ((640, 480) if index == 0 else (600, 400))
        comparison.end_others(scene, built.collection)
        assert space.local_view  # it is the shown capture itself
        assert bpy.ops.scope.compare_view(index=3) == {"CANCELLED"}
        comparison.end(window, area)
    assert space.region_3d.view_perspective != "CAMERA"


def test_one_camera_has_no_others_to_switch_to():
    collection, camera = capture_with_camera("one")
    bpy.context.scene.scope.capture = collection
    assert comparison.cameras_of(bpy.context.scene) == [camera]
    assert not bpy.ops.scope.compare_view.poll()
