# SPDX-License-Identifier: GPL-3.0-or-later
import os
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from scope.scope_addon.footage_view import FootageView
from scope.scope_addon.scene.build import NEW_SCENE, BuildOptions, build_scene
from scope.scope_addon.scene.footage_strip import strips_of
from scope.scope_addon.scene.match_rate import change_rate

from ..made_motion import made_views
from ..required import package


def projected_by_blender(camera: bpy.types.Object, points_world: np.ndarray) -> np.ndarray:
    """(N, 2) pixels from the top left, by the matrix Blender renders with."""
    render = bpy.context.scene.render
    width = render.resolution_x
    height = render.resolution_y
    graph = bpy.context.evaluated_depsgraph_get()
    posed = camera.evaluated_get(graph)
    aspect = {"scale_x": render.pixel_aspect_x, "scale_y": render.pixel_aspect_y}
    P = np.array(posed.calc_matrix_camera(graph, x=width, y=height, **aspect))
    view = np.linalg.inv(np.array(posed.matrix_world))
    homogeneous = np.concatenate([points_world, np.ones((len(points_world), 1))], axis=1)
    clip = homogeneous @ (P @ view).T
    ndc = clip[:, :2] / clip[:, 3:]
    return np.stack([(ndc[:, 0] + 1) / 2 * width, (1 - ndc[:, 1]) / 2 * height], axis=1)


def built_camera(motion, body, footage=None, options=NEW_SCENE) -> bpy.types.Object:
    """Return the camera of a capture, which is built without warnings."""
    result = build_scene([motion], body, footage, options)
    assert result.warnings == []
    return result.people[0].camera


def save_picture(path: Path) -> None:
    image = bpy.data.images.new("picture", 64, 48)
    image.filepath_raw = str(path)
    image.file_format = "PNG"
    image.save()


def projected_by_intrinsics(motion, t: int) -> np.ndarray:
    p = motion.joints_cam[t] @ motion.intrinsics_of_frames[t].T
    return p[:, :2] / p[:, 2:]


@pytest.mark.parametrize(
    ("size", "lens"),
    [
        ((1080, 1920), (900.0, 900.0, 0.41, 0.63)),
        ((1080, 1920), (600.0, 900.0, 0.45, 0.57)),  # wide pixels
        ((1920, 1080), (900.0, 700.0, 0.52, 0.4)),  # tall pixels
    ],
)
def test_the_camera_sees_joints_at_their_pixels(body, make_motion, joints_world, size, lens):
    fx, fy, x, y = lens
    K = np.array([[fx, 0, x * size[0]], [0, fy, y * size[1]], [0, 0, 1]])
    motion = make_motion(body, 8, image_size=size, intrinsics=K)
    camera = built_camera(motion, body)
    pixels = projected_by_blender(camera, joints_world(motion)[5])
    np.testing.assert_allclose(pixels, projected_by_intrinsics(motion, 5), atol=0.05)


def test_a_moving_camera_is_keyed(body, make_motion, joints_world, blender):
    motion = make_motion(body, 20, moving_camera=True)
    camera = built_camera(motion, body)
    for t in (0, 9, 19):
        blender.go_to(t)
        pixels = projected_by_blender(camera, joints_world(motion)[t])
        np.testing.assert_allclose(pixels, projected_by_intrinsics(motion, t), atol=0.05)


def test_a_lens_that_zooms_is_keyed(body, make_motion, joints_world, blender, clip):
    """Beside the frames of the footage, and also after the scene's rate has changed."""
    scene = bpy.context.scene
    scene.render.fps = 20
    motion = replace(
        make_motion(body, 20, rate=30.0, image_size=(64, 48)), zoom=np.geomspace(1.0, 2.0, 20)
    )
    options = BuildOptions(resolution="set", start_frame=0.0)
    person = build_scene([motion], body, footage=clip, options=options).people[0]
    for rate in (20, 30, 15):
        change_rate(scene, rate, {person.armature: motion}, [])
        for t in (0, 8, 18):
            blender.go_to(t * rate / 30)
            pixels = projected_by_blender(person.camera, joints_world(motion)[t])
            np.testing.assert_allclose(pixels, projected_by_intrinsics(motion, t), atol=0.05)
            assert abs(frame_shown(person.camera, round(t * rate / 30)) - t) <= 1.0


@pytest.fixture(scope="module")
def film(tmp_path_factory) -> bytes:
    """A video of five frames of 64 x 48 at 30 frames per second, encoded by Blender."""
    path = tmp_path_factory.mktemp("film") / "film.mp4"
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    render = bpy.context.scene.render
    if bpy.app.version >= (5, 0, 0):
        render.image_settings.media_type = "VIDEO"
    render.image_settings.file_format = "FFMPEG"
    render.ffmpeg.format = "MPEG4"
    render.ffmpeg.codec = "MPEG4"
    render.engine = "CYCLES"
    render.fps = 30
    render.resolution_x = 64
    render.resolution_y = 48
    render.filepath = str(path)
    render.use_file_extension = False
    scene = bpy.context.scene
    scene.cycles.samples = 1
    scene.frame_start = 1
    scene.frame_end = 5
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.ops.render.render(animation=True)
    return path.read_bytes()


@pytest.fixture
def clip(film, tmp_path) -> Path:
    """The video in a folder of the test's own."""
    path = tmp_path / "film.mp4"
    path.write_bytes(film)
    return path


def test_footage_is_shown_in_the_background(body, make_motion, clip):
    motion = make_motion(body, 5, image_size=(64, 48))
    options = BuildOptions(frame_rate="set", start_frame=1.0)
    camera = built_camera(motion, body, clip, options)
    background = camera.data.background_images[0]
    assert (background.source, background.image.source) == ("IMAGE", "MOVIE")
    assert background.image.filepath.endswith(clip.name)
    assert [frame_shown(camera, f) for f in (1, 3, 5)] == [0, 2, 4]
    assert camera.data.animation_data is None
    assert camera.data.show_background_images
    assert not bpy.data.movieclips  # Blender crashes when one is deleted that is shown


def distorted_by_opencv(points: np.ndarray, K: np.ndarray, dist: np.ndarray) -> np.ndarray:
    """(N, 2) pixels in the picture of points (N, 2) in that of a pinhole."""
    cv2 = package("cv2")
    rays = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ np.linalg.inv(K).T
    return cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, dist)[0][:, 0]


def undistorted_by_blender(clip: bpy.types.MovieClip, folder: Path) -> np.ndarray:
    """Return the clip's picture (H, W) as Blender shows it undistorted, rows from the top.

    Through the sequencer, which asks for it as the viewport does. The compositor does not: it
    forgets the pixel aspect.
    """
    scene = bpy.context.scene
    render = bpy.context.scene.render
    strip = strips_of(scene.sequence_editor_create()).new_clip(
        "undistorted", clip, 1, scene.frame_current
    )
    strip.undistort = True
    render.filepath = str(folder / "undistorted.png")
    render.image_settings.file_format = "PNG"
    render.image_settings.color_depth = "16"
    scene.view_settings.view_transform = "Raw"
    scene.sequencer_colorspace_settings.name = "Non-Color"
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(render.filepath)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(4 * image.size[0] * image.size[1], np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)[::-1, :, 0]


@pytest.mark.parametrize(
    ("dist", "fy"),
    [([-0.2, 0.05, 0.0, 0.0, 0.01], 300.0), ([-0.1, 0.03, 0.02, -0.03, 0.0], 360.0)],
)
def test_blender_undistorts_as_opencv_distorts(body, make_motion, tmp_path, dist, fy):
    """Blobs at five points distorted by OpenCV's model are undistorted to the pinhole
    projection.
    """
    width = 320
    height = 240
    K = np.array([[300.0, 0, 150], [0, fy, 130], [0, 0, 1]])
    points = np.array([[90.0, 70], [230, 80], [100, 170], [220, 165], [160, 60]])
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    blobs = [
        np.exp(-((x - u) ** 2 + (y - v) ** 2) / 18)
        for u, v in distorted_by_opencv(points, K, np.array(dist))
    ]
    picture = tmp_path / "still.png"
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = np.sum(blobs, axis=0)[::-1, :, None].clip(0, 1)
    image = bpy.data.images.new("still", width, height)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw = str(picture)
    image.file_format = "PNG"
    image.save()
    motion = make_motion(body, 1, image_size=(width, height), intrinsics=K)
    motion.dist[:] = dist
    camera = built_camera(motion, body, picture)
    (background,) = camera.data.background_images
    assert background.clip_user.use_render_undistorted
    clip = background.clip
    clip.colorspace_settings.name = "Non-Color"
    seen = undistorted_by_blender(clip, tmp_path)
    found = []
    while seen.max() > 0.2:
        v, u = np.unravel_index(seen.argmax(), seen.shape)
        near = (x - u) ** 2 + (y - v) ** 2 < 15**2
        found.append([(seen * near * c).sum() / (seen * near).sum() for c in (x, y)])
        seen = np.where(near, 0, seen)
    np.testing.assert_allclose(sorted(found), sorted(points.tolist()), atol=0.1)


def frame_shown(camera: bpy.types.Object, scene_frame: int) -> int:
    """Return the frame of a video that Blender shows if it is as long, counted from 0:
    BKE_image_user_frame_get.
    """
    bpy.context.scene.frame_set(scene_frame)
    user = (
        camera.evaluated_get(bpy.context.evaluated_depsgraph_get())
        .data.background_images[0]
        .image_user
    )
    count = min(max(scene_frame - user.frame_start + 1, 0), user.frame_duration)
    return count + user.frame_offset - 1


@pytest.mark.parametrize(("before", "after"), [(20, 30), (30, 24)])
def test_footage_stays_synchronized_when_the_scenes_rate_changes(
    body, make_motion, clip, before, after
):
    scene = bpy.context.scene
    scene.render.fps = before
    motion = make_motion(body, 20, rate=30.0, image_size=(64, 48), moving_camera=True)
    person = build_scene(
        [motion], body, footage=clip, options=BuildOptions(start_frame=5.0)
    ).people[0]
    person.camera.data.background_images[0].alpha = 0.25
    assert change_rate(scene, after, {person.armature: motion}, []) == []
    (background,) = person.camera.data.background_images
    assert background.alpha == 0.25
    if after == 30:
        assert not any("footage" in action.name for action in bpy.data.actions)
    for f in range(5, 5 + 15):
        assert abs(frame_shown(person.camera, f) - (f - 5) / after * 30) <= 0.5 + 1e-3
    assert not bpy.data.movieclips
    scene.frame_set(5 + round(0.5 * after))
    np.testing.assert_allclose(
        person.camera.location, motion.world_from_camera[15, :3, 3], atol=1e-4
    )


def test_footage_of_a_distorting_lens_at_another_rate_is_warned_about(body, make_motion, clip):
    bpy.context.scene.render.fps = 24
    motion = make_motion(body, 20, rate=30.0, image_size=(64, 48))
    motion.dist[0] = -0.1
    result = build_scene([motion], body, footage=clip)
    assert len(result.warnings) == 1
    assert "drifts from the motion by up to 4 frames" in str(result.warnings[0])


def test_numbered_pictures_are_shown_in_sequence(body, make_motion, tmp_path):
    numbers = [7, 8, 10, 11]  # one is missing
    save_pictures(tmp_path, numbers)
    motion = make_motion(
        body, timestamps=np.array([0, 1, 3, 4]) / 24, rate=24.0, image_size=(64, 48)
    )
    camera = built_camera(motion, body, tmp_path / "walk_0007.png")
    assert camera.data.background_images[0].image.source == "SEQUENCE"
    assert camera.data.background_images[0].image.filepath.endswith("walk_0007.png")
    # Pictures are named by a count from 1.
    shown = [frame_shown(camera, f) + 1 for f in range(5)]
    assert shown[:2] + shown[3:] == numbers
    assert shown[2] in (8, 10)


def save_pictures(folder, numbers):
    for number in numbers:
        save_picture(folder / f"walk_{number:04d}.png")


@pytest.mark.parametrize(
    ("offset", "numbers", "expected"),
    [
        (-2, range(7, 9), [7, 7, 7, 8, 8]),  # it began two pictures later, and ended earlier
        (0, [7, 8, 10, 11, 12], [7, 8, 8, 10, 11]),  # one is missing
    ],
)
def test_numbered_pictures_of_a_further_camera_are_shown_by_its_clock(
    body, make_motion, clip, tmp_path, offset, numbers, expected
):
    save_pictures(tmp_path, numbers)
    views = made_views(offset / 30) | {
        "view_image_sizes": np.array([[64, 48]]),
        "view_frame_rates": np.array([30.0]),
    }
    motion = replace(make_motion(body, 5, rate=30.0, image_size=(64, 48)), views=views)
    options = replace(NEW_SCENE, view_footage=[tmp_path / f"walk_{numbers[0]:04d}.png"])
    built = build_scene([motion], body, clip, options)
    _, second = (obj for obj in built.collection.objects if obj.type == "CAMERA")
    assert built.warnings == []
    assert [frame_shown(second, f) + 1 for f in range(5)] == expected


@pytest.mark.parametrize(
    "names",
    [("20261122101500.png", "20261122101501.png"), ("1_1080p.png", "2_1080p.png")],
    ids=["beyond its frames", "elsewhere than it counts"],
)
def test_pictures_that_blender_cannot_count_are_warned_about(body, make_motion, tmp_path, names):
    for name in names:
        save_picture(tmp_path / name)
    motion = make_motion(body, 2, image_size=(64, 48))
    result = build_scene([motion], body, footage=tmp_path / names[0], options=NEW_SCENE)
    assert result.people[0].camera.data.background_images[0].image.source == "FILE"
    assert len(result.warnings) == 1
    said = str(result.warnings[0])
    assert "too large or not the last ones in their names, so the camera shows that image" in said


def shown_by_blender(
    background: bpy.types.CameraBackgroundImage, size: tuple[int, int], frame: tuple[int, int]
) -> np.ndarray:
    """The (3, 3) map from the file's picture to the frame, both from −1 to 1 with y up.

    Blender fits the picture into the frame, scales it, exchanges its sides, and turns it clockwise
    (image_camera_background_matrix_get of overlay_image).
    """
    image_aspect = size[0] / size[1]
    frame_aspect = frame[0] / frame[1]
    width, height = float(frame[0]), float(frame[1])
    if image_aspect > frame_aspect:
        height = width / image_aspect
    else:
        width = height * image_aspect
    flip = [-1 if background.use_flip_x else 1, -1 if background.use_flip_y else 1]
    fitted = np.diag([width * flip[0], height * flip[1]]) * background.scale / 2
    c, s = np.cos(-background.rotation), np.sin(-background.rotation)
    return np.diag([2 / frame[0], 2 / frame[1]]) @ np.array([[c, -s], [s, c]]) @ fitted


def assert_corner_is_shown(body, motion, footage, view: FootageView, captured: np.ndarray) -> None:
    """Check that Blender shows the white corner of the file's picture, ``CORNER``, where
    the captured picture (H, W, 3) has it.

    :param view: by which the user has turned the picture.
    """
    size = captured.shape[1], captured.shape[0]
    motion.footage_rotation, motion.footage_mirrored = view.clockwise_deg, view.is_mirrored
    background = built_camera(motion, body, footage).data.background_images[0]
    u, v = shown_by_blender(background, (64, 48), size) @ [2 * 8 / 64 - 1, 1 - 2 * 4 / 48]
    row, column = np.argwhere(captured[..., 0] > 128).mean(axis=0)
    assert (u + 1) / 2 * size[0] == pytest.approx(column + 0.5, abs=0.1)
    assert (1 - v) / 2 * size[1] == pytest.approx(row + 0.5, abs=0.1)


CORNER = np.zeros((48, 64, 3), np.uint8)
CORNER[:8, :16] = 255


@pytest.mark.parametrize(
    "view", [FootageView(90), FootageView(180, True), FootageView(270, True)], ids=str
)
def test_turned_and_mirrored_footage_is_shown_as_it_was_captured(body, make_motion, clip, view):
    motion = make_motion(body, 5, image_size=view.size(64, 48))
    assert_corner_is_shown(body, motion, clip, view, view.show(CORNER))


@pytest.mark.parametrize(
    ("orientation", "chosen", "k1"),
    [
        (6, FootageView(), 0.0),
        (4, FootageView(), -0.1),
        (5, FootageView(90, True), 0.0),
        (8, FootageView(90, True), -0.1),
    ],
)
def test_a_picture_is_turned_as_its_exif_says(body, make_motion, tmp_path, orientation, chosen, k1):
    """Blender shows it as it is stored."""
    cv2 = package("cv2")
    from ..capture.media.stills.test_exif import exif_block, jpeg_with_exif

    path = tmp_path / "photo.jpg"
    path.write_bytes(jpeg_with_exif(CORNER, exif_block(orientation)))
    captured = chosen.show(cv2.imread(str(path)))
    motion = make_motion(body, 1, image_size=(captured.shape[1], captured.shape[0]))
    motion.dist[0] = k1  # a distorting lens is shown as a clip
    assert_corner_is_shown(body, motion, path, chosen, captured)


@pytest.mark.parametrize("k1", [0.0, -0.1])
def test_footage_that_lacks_frames_before_the_captured_ones_is_shown_by_time(
    body, make_motion, clip, k1
):
    """Blender counts frames by time: its third one is shown a tenth of a second after the first,
    also where the file has only one before it.
    """
    times = np.array([3, 4, 5]) / 30
    motion = make_motion(body, timestamps=times, rate=30.0, image_size=(64, 48))
    motion.frames[:] = [1, 2, 3]
    motion.dist[0] = k1  # a distorting lens is shown as a clip
    camera = built_camera(motion, body, clip)
    if k1:
        assert camera.data.background_images[0].clip.frame_start == 0
    else:
        assert [frame_shown(camera, f) for f in (3, 4, 5)] == [3, 4, 5]


@pytest.mark.skipif(os.name == "nt", reason="a backslash separates folders there")
def test_footage_whose_name_has_a_backslash_is_not_shown_and_said(body, make_motion, clip):
    """Blender takes it for a slash."""
    path = clip.rename(clip.with_name("back\\slash.mp4"))
    motion = make_motion(body, 5, image_size=(64, 48))
    result = build_scene([motion], body, footage=path, options=NEW_SCENE)
    assert [warning.code for warning in result.warnings] == ["undecodable_footage"]


@pytest.mark.parametrize("rate", [30.0, 15.0])  # of the first camera; the film has 30
def test_every_footage_is_shown_by_its_own_clock(body, make_motion, clip, rate):
    views = made_views(2 / 30) | {
        "view_image_sizes": np.array([[64, 48]]),
        "view_frame_rates": np.array([30.0]),
    }
    motion = make_motion(body, 2, rate=rate, image_size=(64, 48))
    motion = replace(motion, views=views)
    options = replace(NEW_SCENE, view_footage=[clip])
    built = build_scene([motion], body, clip, options)
    _, second = (obj for obj in built.collection.objects if obj.type == "CAMERA")
    step = round(30 / rate)
    assert [frame_shown(second, f) for f in (0, 1)] == [2, 2 + step]
    assert built.warnings == []
    armature = built.people[0].armature
    change_rate(bpy.context.scene, 60.0, {armature: motion}, [])
    assert [frame_shown(second, f) for f in (0, 2 * step)] == [2, 2 + step]
