# SPDX-License-Identifier: GPL-3.0-or-later
"""The overlay: where bodies are drawn, which pixels do not change, and how files are written."""

from __future__ import annotations

import os
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from scope.scope_addon.capture import overlay_video
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.media.video_writer import VideoWriter
from scope.scope_addon.capture.overlay_video import (
    body_colors,
    camera_vertices,
    draw_overlay,
    painted_frames,
    tint,
    write_overlay,
)
from scope.scope_addon.errors import OutputError, VideoError
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL, world_from_level_camera
from scope.scope_addon.motion import Motion
from scope.solver.body import Body
from scope.solver.errors import ShapeError

from ..made_motion import made_face, made_motion
from .media.made_video import with_time_table

W = 160
H = 120
K = np.array([[130.0, 0, 80.0], [0, 130.0, 60.0], [0, 0, 1]])
GREY = 90


def standing(
    body: Body, frames: list[int], x: float = 0.0, y: float = 3.0, size=(W, H), intrinsics=K
) -> Motion:
    """Create a person in T-pose ``y`` metres in front of a level camera at 1 m, seen in every
    frame.
    """
    T = len(frames)
    K1 = body.K + 1
    poses = np.zeros((T, K1, 3), np.float32)
    poses[:, 0] = cv2.Rodrigues(R_WORLD_MODEL)[0].ravel()
    trans = np.tile(np.array([x, y, 0.95]) - body.J_template[0], (T, 1))
    return made_motion(
        body,
        poses,
        trans,
        frames=np.array(frames),
        timestamps=np.array(frames) / 30,
        intrinsics=intrinsics,
        world_from_camera=np.tile(world_from_level_camera(np.array([0, -1.0, 0]), 1.0), (T, 1, 1)),
        image_size=np.array(size),
    )


@pytest.fixture
def footage(tmp_path) -> Path:
    """Write ten grey frames at 25 per second."""
    path = tmp_path / "footage.mp4"
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), 25, (W, H))
    for _ in range(10):
        writer.write(np.full((H, W, 3), GREY, np.uint8))
    writer.release()
    return path


def changed(image: np.ndarray) -> np.ndarray:
    """Find the pixels (H, W) that clearly differ from the grey of the footage."""
    return np.abs(image.astype(int) - GREY).max(-1) > 12


def silhouette(body: Body, x: float = 0.0, y: float = 3.0) -> np.ndarray:
    """Draw the silhouette (H, W) with OpenCV's polygons, posed by hand: x stays, model y is up,
    facing the camera.
    """
    offset = body.v_template - body.J_template[0]
    points = np.stack([x + offset[:, 0], 1.0 - (0.95 + offset[:, 1]), y - offset[:, 2]], -1)
    pixels = np.round((points[:, :2] / points[:, 2:] @ K[:2, :2].T + K[:2, 2]) * 256).astype(
        np.int32
    )
    mask = np.zeros((H, W), np.uint8)
    for quad in body.faces:
        cv2.fillConvexPoly(mask, pixels[quad], (1,), shift=8)
    return mask > 0


def intersection_over_union(a: np.ndarray, b: np.ndarray) -> float:
    return (a & b).sum() / (a | b).sum()


def test_vertices_are_in_the_camera_of_their_row(body):
    motion = standing(body, [0, 1])
    rng = np.random.default_rng(2)
    rotation = cv2.Rodrigues(rng.normal(size=3))[0]
    motion.world_from_camera[1] = np.block(
        [[rotation, rng.normal(size=(3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]]
    )
    motion.betas[:2] = (1.5, -2.0)
    rest = body.v_template + body.shapedirs @ motion.betas.astype(float)
    pelvis = body.J_template[0] + body.J_shapedirs[0] @ motion.betas.astype(float)
    world = (rest - pelvis) @ R_WORLD_MODEL.T + pelvis + motion.trans[0]
    for row in (0, 1):
        homogeneous = (
            np.c_[world, np.ones(len(world))] @ np.linalg.inv(motion.world_from_camera[row]).T
        )
        np.testing.assert_allclose(
            camera_vertices(motion, body, row), homogeneous[:, :3], atol=1e-5
        )


def test_the_video_shows_the_body_where_it_is_and_nothing_elsewhere(
    tmp_path, footage, body, monkeypatch
):
    monkeypatch.setattr(overlay_video, "OPACITY", 0.8)
    seen = []
    out = tmp_path / "overlay.mp4"
    motion = standing(body, [2, 3, 4, 5, 6], x=0.3)
    motion.valid[2] = False
    write_overlay(
        out, footage, [motion], body, progress=lambda done, total: seen.append((done, total))
    )
    with open_video(out) as video:
        images = [f.image_rgb for f in video]
    assert (video.width, video.height, video.fps, len(images)) == (W, H, 25, 10)
    assert seen == [(i, 10) for i in range(1, 11)]
    for i in (0, 1, 7, 8, 9):
        assert changed(images[i]).mean() < 0.01
    expected = silhouette(body, x=0.3)
    for i in (2, 3, 5, 6):
        # at this size the codec blurs the outline
        assert intersection_over_union(changed(images[i]), expected) > 0.65
    strength = [np.abs(image[expected].astype(float) - GREY).mean() for image in images]
    assert 0.1 * strength[3] < strength[4] < 0.6 * strength[3]  # filled in: drawn fainter
    assert sorted(p.name for p in tmp_path.iterdir()) == ["footage.mp4", "overlay.mp4"]


def test_two_people_have_different_colours_and_the_nearer_occludes_the_other(body):
    image = np.full((H, W, 3), GREY, np.uint8)
    near, far = (
        camera_vertices(standing(body, [0], x, y), body, 0) for x, y in ((0.0, 2.5), (0.2, 4.0))
    )
    orange, blue = tint(0), tint(1)
    out = draw_overlay(image, [far, near], body.faces, K, None, [orange, blue], [1.0, 1.0])
    other = draw_overlay(image, [near, far], body.faces, K, None, [blue, orange], [1.0, 1.0])
    np.testing.assert_array_equal(out, other)
    in_front = silhouette(body, 0.0, 2.5)
    behind = silhouette(body, 0.2, 4.0)
    inside, only_far = (
        cv2.erode(m.astype(np.uint8), np.ones((3, 3))) > 0 for m in (in_front, behind & ~in_front)
    )
    is_blue = out[..., 2].astype(int) > out[..., 0]
    assert is_blue[inside].mean() > 0.98  # the second tint; an eye may be of its own colour
    assert is_blue[only_far].mean() < 0.02  # the first is orange


def test_opacity_blends_and_the_input_image_is_not_changed(body):
    image = np.full((H, W, 3), GREY, np.uint8)
    vertices = camera_vertices(standing(body, [0]), body, 0)
    colors = body_colors(body, 0)
    assert colors.shape == (len(body.faces), 3)
    none, half, full = (
        draw_overlay(image, [vertices], body.faces, K, None, [colors], [a]) for a in (0.0, 0.5, 1.0)
    )
    np.testing.assert_array_equal(none, image)
    assert np.abs(half.astype(int) - (full.astype(int) + GREY) / 2).max() <= 2
    assert (image == GREY).all()


def test_a_picture_suffix_gives_the_first_frame_with_a_person(tmp_path, footage, body):
    motion = standing(body, [0, 1, 2])
    motion.valid[:] = (False, False, True)
    for name in ("still.png", "still.JPG"):
        write_overlay(tmp_path / name, footage, [motion], body)
        image = cv2.cvtColor(cv2.imread(str(tmp_path / name)), cv2.COLOR_BGR2RGB)
        assert intersection_over_union(changed(image), silhouette(body)) > 0.8


def test_confident_keypoints_are_drawn_as_dots(tmp_path, footage, body):
    motion = standing(body, [0])
    motion.keypoints2d = np.array(
        [[[20, 30, 0.9], [20, 90, 0.1], [np.nan, 5, 0.9], [1e9, 5, 0.9]]], np.float32
    )
    motion.keypoints2d_names = np.array(list("abcd"))
    write_overlay(tmp_path / "a.png", footage, [motion], body)
    marks = changed(cv2.imread(str(tmp_path / "a.png")))
    assert marks[30, 20]
    assert not marks[85:95, 15:25].any()


def times_of(path: Path) -> list[float]:
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.time_base is not None
        return [float((frame.pts or 0) * stream.time_base) for frame in container.decode(stream)]


def test_the_video_has_the_times_of_footage_with_a_variable_rate(tmp_path, footage, body):
    """Its frames followed each other at the footage's nominal rate."""
    with_time_table(footage, 1000, [(4, 40), (3, 200), (3, 1)])
    out = tmp_path / "overlay.mp4"
    write_overlay(out, footage, [standing(body, list(range(10)))], body)
    np.testing.assert_allclose(times_of(out), times_of(footage), atol=2e-5)


@pytest.mark.parametrize(
    ("suffix", "rate"), [(".mkv", Fraction(24000, 1001)), (".mp4", Fraction(1000))]
)
def test_the_video_of_footage_with_a_constant_rate_has_exactly_that(tmp_path, body, suffix, rate):
    """Also where the container rounds its times to milliseconds, as Matroska does."""
    footage = tmp_path / f"footage{suffix}"
    out = tmp_path / "overlay.mp4"
    writer = VideoWriter(footage, rate, W, H, footage)
    for _ in range(10):
        writer.write(np.full((H, W, 3), GREY, np.uint8))
    writer.close()
    write_overlay(out, footage, [standing(body, list(range(10)))], body)
    with av.open(str(out)) as container:
        assert container.streams.video[0].average_rate == rate
    np.testing.assert_allclose(times_of(out), [float(k / rate) for k in range(10)], atol=1e-9)


def test_odd_sizes_are_cropped_and_large_ones_are_limited(tmp_path, body):
    picture = cv2.imencode(".jpg", np.full((121, 2401, 3), GREY, np.uint8))[1].tobytes()
    (tmp_path / "wide.mjpeg").write_bytes(picture * 3)
    camera = np.array([[60.0, 0, 1200], [0, 60.0, 60.0], [0, 0, 1]])
    motion = standing(body, [0, 1, 2], size=(2401, 121), intrinsics=camera)
    write_overlay(tmp_path / "a.mp4", tmp_path / "wide.mjpeg", [motion], body)
    with open_video(tmp_path / "a.mp4") as video:
        image = next(iter(video)).image_rgb
    assert (video.width, video.height) == (1920, 96)
    u = np.nonzero(changed(image))[1]
    assert abs(u.mean() - 1200.5 * 1920 / 2401) < 2


@pytest.mark.parametrize("name", ["overlay.gif", "no/such/folder/overlay.mp4"])
def test_unwritable_outputs_are_errors(tmp_path, footage, body, name):
    with pytest.raises(OutputError, match="cannot write"):
        write_overlay(tmp_path / name, footage, [standing(body, [0])], body)
    assert [p.name for p in tmp_path.iterdir()] == ["footage.mp4"]


@pytest.mark.skipif(
    os.name == "nt", reason="Windows has no limit on a file's size that a process could set"
)
@pytest.mark.parametrize(
    ("name", "failed"),
    [("overlay.mp4", "could not finish writing"), ("overlay.png", "cannot write")],
)
def test_a_full_disk_is_an_error_and_keeps_an_earlier_file(tmp_path, footage, body, name, failed):
    import resource

    (tmp_path / name).write_bytes(b"the last one")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, before[1]))
    try:
        with pytest.raises(OutputError, match=f"{failed} .*{name}.*free some space"):
            write_overlay(tmp_path / name, footage, [standing(body, [0])], body)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["footage.mp4", name]
    assert (tmp_path / name).read_bytes() == b"the last one"


@pytest.mark.parametrize("name", ["overlay.mp4", "overlay.png"])
def test_a_range_without_frames_is_an_error_and_leaves_no_file(tmp_path, footage, body, name):
    with pytest.raises(
        VideoError,
        match=r"footage\.mp4 has no frames between the given start and "
        r"end",
    ):
        write_overlay(
            tmp_path / name, footage, [standing(body, [0])], body, wanted=VideoRange(start_s=1.0)
        )
    assert [p.name for p in tmp_path.iterdir()] == ["footage.mp4"]


def test_missing_footage_and_a_wrong_body_are_errors(tmp_path, footage, body):
    with pytest.raises(VideoError):
        write_overlay(tmp_path / "a.mp4", tmp_path / "gone.mp4", [standing(body, [0])], body)
    motion = standing(body, [0])
    motion.joints_cam = np.zeros((1, 52, 3), np.float32)
    with pytest.raises(ShapeError, match="52 joints"):
        write_overlay(tmp_path / "a.mp4", footage, [motion], body)
    assert [p.name for p in tmp_path.iterdir()] == ["footage.mp4"]


def test_the_points_of_a_face_are_drawn_where_it_was_seen(tmp_path, footage, body, monkeypatch):
    monkeypatch.setattr(overlay_video, "OPACITY", 0.0)
    motion = standing(body, [0, 1, 2])
    points = np.full((3, 3, 2), 20.0)
    points[2] = 0.0  # another camera saw it
    motion.face = made_face(3) | {
        "face_points": points,
        "expression_confidence": np.array([0, 1.0, 1.0]),
    }
    with open_video(footage) as video:
        size = (video.height, video.width)
    shown = dict(painted_frames(footage, [motion], body, [0, 1, 2]))
    assert shown[0].shape[:2] == size
    assert abs(int(shown[0][20, 20].max()) - GREY) < 10
    assert shown[1][20, 20].min() > 200
    assert abs(int(shown[2][0, 0].max()) - GREY) < 10
