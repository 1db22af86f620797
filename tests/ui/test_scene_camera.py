# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera of the scene as that of the footage: its lens and poses against Blender's own view."""

import json
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from scope.scope_addon.capture.camera.given_path import read_camera_path
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.errors import UsageError
from scope.scope_addon.scene.camera import blender_brown_distortion
from scope.scope_addon.ui import scene_camera
from scope.scope_addon.ui.capture_job import capture_request

POINTS = [(0.3, 5.0, 1.0), (-1.2, 7.0, 2.5), (0.0, 4.0, -0.5)]
LAST = 12


@pytest.fixture
def camera(footage):
    """A camera that turns and travels, chosen in the panel."""
    scene = bpy.context.scene
    scene.render.fps = 24
    scene.render.resolution_x, scene.render.resolution_y = 1280, 720
    scene.frame_start, scene.frame_end = 1, LAST
    obj = bpy.data.objects.new("Solved", bpy.data.cameras.new("Solved"))
    scene.collection.objects.link(obj)
    for frame in (1, LAST):
        obj.location = (0.1 * frame, -0.05 * frame, 1.5)
        obj.rotation_euler = (1.5, 0.02 * frame, -0.03 * frame)
        obj.keyframe_insert("location", frame=frame)
        obj.keyframe_insert("rotation_euler", frame=frame)
    scene.scope.footage = str(footage)
    scene.scope.lens = "CAMERA"
    scene.scope.scene_camera = obj
    return obj


def path_of_request():
    return Path(capture_request(bpy.context.scene).values["camera_path"])


@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize("size", [(1280, 720), (720, 1280)])
@pytest.mark.parametrize("aspect", [(1.0, 1.0), (1.0, 1.4)])
def test_points_are_where_blender_shows_them(camera, fit, size, aspect):
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect
    camera.data.sensor_fit = fit
    camera.data.lens = 40.0
    camera.data.shift_x, camera.data.shift_y = 0.1, -0.05
    scene.frame_set(5)
    shown = scene.frame_current
    path = read_camera_path(path_of_request())
    assert scene.frame_current == shown
    K = path.calibration.intrinsics
    for frame in (1, 6, LAST):
        scene.frame_set(frame)
        pose = path.at(np.array([(frame - scene.scope.start_frame) / 24.0]))[0]
        for point in POINTS:
            local = np.linalg.inv(pose) @ [*point, 1.0]
            pixel = K @ (local[:3] / local[2])
            u, v, depth = world_to_camera_view(scene, camera, Vector(point))
            np.testing.assert_allclose(
                [pixel[0] / size[0], 1.0 - pixel[1] / size[1], local[2]], [u, v, depth], atol=1e-4
            )


def test_the_same_camera_has_the_same_file_and_time(camera):
    first = path_of_request()
    time = first.stat().st_mtime_ns
    assert path_of_request() == first
    assert first.stat().st_mtime_ns == time
    camera.data.lens = 70.0
    assert path_of_request() != first


def test_positions_are_in_metres(camera):
    in_metres = json.loads(path_of_request().read_text())["world_from_camera"]
    bpy.context.scene.unit_settings.scale_length = 0.01
    in_cm = json.loads(path_of_request().read_text())["world_from_camera"]
    np.testing.assert_allclose(np.array(in_cm)[:, :3, 3], 0.01 * np.array(in_metres)[:, :3, 3])


def hide(camera):
    camera.hide_viewport = True


def exclude(camera):
    tracking = move_to_collection(camera)
    bpy.context.view_layer.layer_collection.children[tracking.name].exclude = True


def hide_collection(camera):
    move_to_collection(camera).hide_viewport = True


def move_to_collection(camera):
    tracking = bpy.data.collections.new("Tracking")
    bpy.context.scene.collection.children.link(tracking)
    tracking.objects.link(camera)
    bpy.context.scene.collection.objects.unlink(camera)
    return tracking


@pytest.mark.parametrize("hidden_by", [hide, exclude, hide_collection])
def test_a_hidden_camera_moves_as_a_shown_one(camera, hidden_by):
    shown = json.loads(path_of_request().read_text())
    hidden_by(camera)
    layer = bpy.context.view_layer
    before = camera.visible_get(view_layer=layer), list(camera.users_collection)
    assert json.loads(path_of_request().read_text()) == shown
    assert (camera.visible_get(view_layer=layer), list(camera.users_collection)) == before
    assert not before[0]


def scale(camera):
    camera.scale = (2.0, 2.0, 2.0)


def place_nowhere(camera):
    camera.animation_data_clear()
    camera.location = (float("nan"), 0.0, 0.0)


def zoom(camera):
    for frame, lens in ((1, 30.0), (LAST, 60.0)):
        camera.data.lens = lens
        camera.data.keyframe_insert("lens", frame=frame)


def follow_a_clip(camera):
    camera.constraints.new("CAMERA_SOLVER")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda camera: setattr(bpy.context.scene.scope, "scene_camera", None),
            "camera of the scene is",
        ),
        (
            lambda camera: bpy.context.scene.collection.objects.unlink(camera),
            "is not in this scene",
        ),
        (lambda camera: setattr(camera.data, "type", "ORTHO"), "is ortho; footage is filmed"),
        (scale, "is scaled or sheared in frame 1; apply its scale"),
        (place_nowhere, "has no finite place in frame 1"),
        (zoom, "zooms by a factor of 2.00"),
        (follow_a_clip, "is solved in no frame"),
    ],
)
def test_a_camera_that_cannot_have_filmed_it_is_refused(camera, change, says):
    change(camera)
    with pytest.raises(RuntimeError, match=says):
        bpy.ops.scope.capture()


@pytest.mark.parametrize(
    ("clip", "expected"),
    [
        ({"fps": 25.0, "frame_offset": 0}, (3, 25.0)),
        ({"fps": 25.0, "frame_offset": 30}, (-27, 25.0)),
        ({"fps": 0.0, "frame_offset": 2}, (1, 30.0)),  # images, and so is the footage
        (None, (5, 24.0)),
    ],
)
def test_a_tracked_clip_tells_the_times_whatever_the_scenes_rate_is(
    camera, monkeypatch, clip, expected
):
    clips = [SimpleNamespace(frame_start=3, **clip)] if clip else []
    monkeypatch.setattr(scene_camera, "_tracked_clips", lambda *_: clips)
    scene = bpy.context.scene
    scene.scope.start_frame = 5
    before = len(bpy.data.movieclips)
    assert scene_camera._footage_frames(scene, camera) == expected
    assert len(bpy.data.movieclips) == before


def test_images_that_were_tracked_are_the_frames_of_a_video(camera, monkeypatch):
    images = SimpleNamespace(frame_start=3, frame_offset=0, fps=0.0)
    monkeypatch.setattr(scene_camera, "_tracked_clips", lambda *_: [images])
    scene = bpy.context.scene
    scene.scope.footage = str(SAMPLE)
    rate = bpy.data.movieclips.load(str(SAMPLE)).fps
    assert rate != scene.render.fps
    assert scene_camera._footage_frames(scene, camera) == (3, pytest.approx(rate))


def test_the_distortion_of_a_tracked_clip_is_that_of_the_footage(camera, monkeypatch):
    clip = bpy.data.movieclips.load(str(SAMPLE))
    lens = clip.tracking.camera
    lens.units = "PIXELS"
    lens.focal_length_pixels = 900.0
    monkeypatch.setattr(scene_camera, "_tracked_clips", lambda *_: [clip])
    scene = bpy.context.scene
    lens.distortion_model = "POLYNOMIAL"
    lens.k1, lens.k2, lens.k3 = -0.08, 0.02, 0.003
    assert scene_camera._distortion(scene, camera) == pytest.approx([-0.08, 0.02, 0, 0, 0.003])
    lens.distortion_model = "BROWN"
    lens.brown_k1, lens.brown_k2, lens.brown_k3 = -0.08, 0.02, 0.003
    lens.brown_p1, lens.brown_p2 = 0.001, -0.002
    dist = scene_camera._distortion(scene, camera)
    back = blender_brown_distortion(np.array(dist))
    assert back == pytest.approx((-0.08, 0.02, 0.003, 0.001, -0.002))
    lens.distortion_model = "DIVISION"
    lens.division_k1 = 0.1
    with pytest.raises(UsageError, match="division_k1 of the model Division"):
        scene_camera._distortion(scene, camera)
