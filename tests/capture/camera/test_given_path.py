# SPDX-License-Identifier: GPL-3.0-or-later
"""The file with the path of a camera that another program has solved."""

import json
import os
import sys
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.background_record import CameraMotion
from scope.scope_addon.capture.camera.given_path import read_camera_path
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.media.video import StatedRate, Video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.observe import _doubts_about_path, _given_path
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.errors import UsageError
from scope.solver.errors import InputError
from scope.solver.rotations import exp, log

ALL_S = np.arange(50) / 25.0  # times of the poses in the file
LENS = {"intrinsics": [[1000, 0, 640], [0, 1000, 360], [0, 0, 1]], "size": [1280, 720]}


def true_poses(times_s):
    """A camera that turns at a constant rate while it travels along a line."""
    poses = np.tile(np.eye(4), (len(times_s), 1, 1))
    poses[:, :3, :3] = exp(times_s[:, None] * [0.3, -0.2, 0.1])
    poses[:, :3, 3] = times_s[:, None] * [1.0, 0.5, -0.2] + [0.0, 0.0, 1.6]
    return poses


def written(tmp_path, name="camera.json", **changes):
    values = {"times_s": ALL_S, "world_from_camera": true_poses(ALL_S)} | changes
    path = tmp_path / name
    path.write_text(json.dumps(LENS | values, default=np.ndarray.tolist))
    return path


def test_poses_between_those_of_the_file_are_interpolated(tmp_path):
    path = read_camera_path(written(tmp_path))
    times_s = np.array([0.0, 0.013, 0.5, 1.234, 1.96])
    found = path.at(times_s)
    true = true_poses(times_s)
    np.testing.assert_allclose(found[:, :3, 3], true[:, :3, 3], atol=1e-9)
    off = log(np.swapaxes(found[:, :3, :3], 1, 2) @ true[:, :3, :3])
    np.testing.assert_allclose(off, 0.0, atol=1e-9)


def test_a_path_of_all_frames_is_accepted_where_the_frame_rate_varies(tmp_path):
    """Most frames come at 24 frames/s, but 50 are in a second on average: 40 s, not 83."""
    rate = StatedRate(Fraction(24), average_fps=Fraction(50))
    video = Video(Path("clip.mp4"), 640, 480, Fraction(24), 50 * 40, rate=rate)
    times_s = np.arange(41.0)
    path = written(tmp_path, times_s=times_s, world_from_camera=true_poses(times_s))
    assert _given_path(video, CaptureOptions(camera_path=path)) is not None
    video.wanted = VideoRange(start_s=20.0, end_s=30.0)
    assert video.length_s == pytest.approx(10.0 + 1 / 50)  # with the frames at both ends


def test_one_pose_is_that_of_a_camera_that_stands(tmp_path):
    pose = true_poses(np.array([0.7]))
    path = read_camera_path(written(tmp_path, times_s=[0.0], world_from_camera=pose))
    np.testing.assert_allclose(path.at(np.array([0.0, 9.0])), np.tile(pose, (2, 1, 1)), atol=1e-9)


def test_the_lens_is_that_of_the_file(tmp_path):
    path = written(tmp_path)
    camera = choose_camera(1920, 1080, camera_path=path)
    np.testing.assert_allclose(camera.intrinsics[0], [1500, 0, 960])
    with pytest.raises(UsageError, match=r"--fov and --camera-path contradict each other"):
        choose_camera(1920, 1080, camera_path=path, fov_deg=50)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
@pytest.mark.parametrize("kind", ["calibration", "camera path"])
def test_the_lens_names_its_file_as_people_may_see_it(tmp_path, kind):
    """Blender refuses a report with text that is not UTF-8."""
    path = written(tmp_path, os.fsdecode(b"lens\xff.json"))
    if kind == "calibration":
        path.write_text(json.dumps(LENS))
    camera = choose_camera(1280, 720, **{kind.replace(" ", "_"): path})
    assert camera.source == f"{kind} lens\N{REPLACEMENT CHARACTER}.json"


@pytest.mark.parametrize("time_s", [2.5, -0.5])
def test_frames_without_a_pose_are_refused(tmp_path, time_s):
    path = read_camera_path(written(tmp_path))
    with pytest.raises(InputError, match=r"has poses from 0.00 to 1.96 s, but frames"):
        path.at(np.array([time_s]))


def test_a_gap_in_the_captured_part_is_refused(tmp_path):
    times_s = np.delete(ALL_S, np.arange(10, 30))
    poses = true_poses(times_s)
    path = read_camera_path(written(tmp_path, times_s=times_s, world_from_camera=poses))
    path.at(np.array([0.1, 1.5]))
    with pytest.raises(InputError, match=r"has no pose from 0.36 to 1.20 s"):
        path.at(np.array([0.1, 0.8]))


@pytest.mark.parametrize("cut_deg", [0.0, 90.0])
@pytest.mark.parametrize(("begins_s", "codes"), [(0.0, []), (1.0, ["path_contradicts"])])
def test_a_path_of_another_clip_or_time_is_warned_of(begins_s, codes, cut_deg):
    """The camera turns by 30 degrees, and the background by up to 3 degrees more; and at a cut,
    which hides from the background by how much.
    """
    times_s = np.arange(20) / 10.0
    turn = np.radians(15.0) * times_s**2 / 2.0
    axis = np.array([0.0, 1.0, 0.0])
    poses = np.tile(np.eye(4), (20, 1, 1))
    poses[:, :3, :3] = exp((turn + np.radians(cut_deg) * (times_s >= 0.2))[:, None] * axis)
    seen_at = np.radians(15.0) * (times_s + begins_s) ** 2 / 2.0 * 1.1
    R = exp((seen_at - seen_at[0])[:, None] * axis)
    job = SimpleNamespace(
        options=CaptureOptions(camera_path=Path("camera.json")),
        video=SimpleNamespace(path="a.mp4"),
    )
    seen = CameraMotion(R, np.ones(20, bool))
    cuts = np.array([2] if cut_deg else [], np.int64)
    found = _doubts_about_path(job, CameraMotion.given(poses), seen, cuts)
    assert [each.code for each in found] == codes


def changed(row, pose):
    poses = true_poses(ALL_S)
    poses[row] = pose(poses[row])
    return poses


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"world_from_camera": []}, "must be a list of matrices"),
        ({"world_from_camera": [[1, 2], [3]]}, "must be a list of matrices"),
        ({"times_s": [0.0, 1.0]}, "must be a list of 50 numbers"),
        ({"times_s": [*np.arange(49.0), 3.0]}, "numbers that ascend"),
        ({"times_s": [*np.arange(49.0), float("nan")]}, "numbers that ascend"),
        ({"world_from_camera": changed(3, lambda T: T * np.nan)}, "pose 3 .* not a finite number"),
        ({"world_from_camera": changed(4, lambda T: T.T)}, "pose 4 .* last row 0, 0, 0, 1"),
        ({"world_from_camera": changed(5, lambda T: T * [2, 2, 2, 1])}, "pose 5 .* is scaled"),
        ({"world_from_camera": changed(6, lambda T: T * [-1, 1, 1, 1])}, "pose 6 .* or mirrored"),
        ({"focal_px": [1000.0]}, "'focal_px' is unknown"),
        ({"intrinsics": None}, "intrinsics"),
    ],
)
def test_what_is_no_path_is_refused(tmp_path, changes, says):
    with pytest.raises(InputError, match=says):
        read_camera_path(written(tmp_path, **changes))
