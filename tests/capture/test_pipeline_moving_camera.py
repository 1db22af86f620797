# SPDX-License-Identifier: GPL-3.0-or-later
"""A real clip of a static camera, filmed again by a virtual camera that pans and zooms: the world
must stay the same, whether the pan is estimated or given.
"""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import pinhole
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.pipeline import capture
from scope.solver import InputError, load_body
from scope.solver.rotations import exp, log

START = 130
FRAMES = 25  # every second one of the clip
RATE = 15
WIDTH = 960
HEIGHT = 540
FOV = 60.0


def film(source, path, turn, zoom=lambda _: 1.0):
    """Write a clip with each frame as seen by a camera rotated by turn(k) (rotation vector), whose
    focal length is zoom(k) times as long.
    """
    reader = cv2.VideoCapture(str(source))
    reader.set(cv2.CAP_PROP_POS_FRAMES, START)
    out = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), RATE, (WIDTH, HEIGHT))
    K = pinhole(WIDTH, HEIGHT, WIDTH / (2 * np.tan(np.radians(FOV) / 2)))
    for k in range(FRAMES):
        ok, frame = reader.read()
        assert ok
        reader.grab()
        S = np.diag([WIDTH / frame.shape[1], HEIGHT / frame.shape[0], 1.0])
        H = K @ np.diag([zoom(k), zoom(k), 1.0]) @ exp(turn(k)).T @ np.linalg.inv(K) @ S
        out.write(cv2.warpPerspective(frame, H, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REPLICATE))
    out.release()


TURNS = np.sin(2 * np.pi * np.arange(FRAMES) / FRAMES)[:, None] * [0.02, 0.10, 0.01]


@pytest.fixture(scope="module")
def clip(shared):
    return shared / "data" / "clips" / "walk_side_static.mp4"


@pytest.fixture(scope="module")
def pan(clip, tmp_path_factory):
    """The clip of a camera that turns by `TURNS`."""
    path = tmp_path_factory.mktemp("pan") / "pan.mp4"
    film(clip, path, lambda k: TURNS[k])
    return path


@pytest.mark.slow
def test_a_given_pan_is_used_and_gives_the_same_path(pan, tmp_path, observe_frames):
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, :3] = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]) @ exp(TURNS)
    poses[:, :3, 3] = [5.0, -2.0, 40.0]
    content = {
        "intrinsics": pinhole(WIDTH, HEIGHT, WIDTH / (2 * np.tan(np.radians(FOV) / 2))).tolist(),
        "size": [WIDTH, HEIGHT],
        "times_s": (np.arange(FRAMES) / RATE).tolist(),
        "world_from_camera": poses.tolist(),
    }
    file = tmp_path / "camera.json"
    file.write_text(json.dumps(content))
    options = CaptureOptions(quality="fast", camera_path=file)
    found = capture(pan, load_body("scope"), options, observe_frames=observe_frames)
    motion = found.motions[0]
    assert (found.report.up, found.report.camera) == ("given", "camera path camera.json")
    # A second person walks behind, and is found or not.
    codes = {notice.code for notice in found.report.warnings}
    assert codes - {"left_out"} == {"given_floor"}
    np.testing.assert_allclose(motion.world_from_camera[:, :3, :3], poses[:, :3, :3], atol=1e-6)
    np.testing.assert_allclose(motion.world_from_camera[:, :2, 3], poses[:, :2, 3], atol=1e-6)
    assert 0.5 < motion.world_from_camera[0, 2, 3] < 2.5  # metres above the floor
    walked = motion.trans[-1] - motion.trans[5]
    assert 0.8 < np.linalg.norm(walked[:2]) < 2.5
    assert abs(walked[2]) < 0.1

    content["times_s"] = (np.arange(FRAMES) / (10 * RATE)).tolist()
    file.write_text(json.dumps(content))
    beginning = replace(options, wanted=VideoRange(end_s=0.3))
    with pytest.raises(InputError, match=r"has poses from 0.00 to 0.16 s, but frames"):
        capture(pan, load_body("scope"), beginning, observe_frames=observe_frames)


@pytest.mark.slow
def test_the_world_of_a_panning_camera_does_not_move(clip, pan, tmp_path, observe_frames):
    videos = {"stand": tmp_path / "stand.mp4", "pan": pan, "zoom": tmp_path / "zoom.mp4"}
    film(clip, videos["stand"], lambda _: np.zeros(3))
    factors = 1.6 ** np.clip((np.arange(FRAMES) - 5) / 15, 0, 1)
    film(clip, videos["zoom"], lambda _: np.zeros(3), lambda k: factors[k])
    body = load_body("scope")
    options = CaptureOptions(quality="fast", fov_deg=FOV)
    found = {
        name: capture(video, body, options, observe_frames=observe_frames)
        for name, video in videos.items()
    }
    stand, moving, zoomed = (each.motions[0] for each in found.values())

    assert stand.zoom is None
    assert moving.zoom is None
    np.testing.assert_allclose(zoomed.zoom, factors, rtol=0.03)
    far = np.linalg.norm(stand.joints_cam[:, 0], axis=1)
    far_zoomed = np.linalg.norm(zoomed.joints_cam[:, 0], axis=1)
    hips = zoomed.keypoints2d[:, [23, 24], :2].mean(axis=1)
    inside = zoomed.valid & (hips[:, 0] > 50)  # the walker leaves the zoomed picture
    inside[:5] = False
    assert inside.sum() > 10
    ratio = (far_zoomed / far)[inside]
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=0.06)
    p = np.einsum("tij,tkj->tki", zoomed.intrinsics_of_frames, zoomed.joints_cam)
    own = (p[..., :2] / p[..., 2:])[:, [1, 2]].mean(axis=1)
    assert np.median(np.linalg.norm(own - hips, axis=1)) < 15.0

    assert found["stand"].report.camera_turns_deg == 0.0
    assert np.ptp(stand.world_from_camera, axis=0).max() == 0.0
    first = moving.world_from_camera[0, :3, :3]
    turned = np.swapaxes(first[None], 1, 2) @ moving.world_from_camera[:, :3, :3]
    off = np.linalg.norm(log(np.swapaxes(turned, 1, 2) @ exp(TURNS)), axis=1)
    assert np.degrees(off).max() < 0.4

    # the person walks the same way through the same world, seen by either camera
    walked = stand.trans[5:] - moving.trans[5:]  # the first frames are found anew in either clip
    assert np.linalg.norm(stand.trans[-1] - stand.trans[5]) > 0.8
    spread = np.ptp(walked - np.median(walked, axis=0), axis=0)
    assert spread[0] < 0.15  # across the view; one camera knows the distance less well
    assert spread[1] < 0.3
    assert spread[2] < 0.08
    assert moving.residual_px.mean() < 1.5 * stand.residual_px.mean() + 1.0
