# SPDX-License-Identifier: GPL-3.0-or-later
"""Calibration files: their meaning, written out, and which ones are refused rather than misread."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.camera.calibration import (
    placed_cameras,
    read_calibration,
    write_calibration,
)
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.footage_view import FootageView
from scope.solver import load_body
from scope.solver.errors import InputError
from scope.solver.rotations import exp

from ...made_motion import made_motion, made_views

K = [[1000, 0, 500], [0, 1100, 300], [0, 0, 1]]
KNOWN = {"intrinsics": K, "dist": [0.1, 0], "size": [1000, 600]}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "cam.json"


def camera(path, content, width=1000, height=600):
    path.write_text(content if isinstance(content, str) else json.dumps(content), "utf-8")
    return choose_camera(width, height, calibration=path)


def refused(path, content, message, width=1000, height=600):
    with pytest.raises(InputError, match=message) as caught:
        camera(path, content, width, height)
    text = str(caught.value)
    assert "cam.json" in text
    assert "\n" not in text
    assert len(text) < 600


def test_calibration_scales_with_the_footage(path):
    found = camera(path, KNOWN, 2000, 1200)
    assert np.allclose(found.intrinsics, [[2000, 0, 1000], [0, 2200, 600], [0, 0, 1]])
    assert np.allclose(found.dist, [0.1, 0, 0, 0, 0])


def test_undistorted_points_project_back_through_the_distortion(path):
    lens = {
        "intrinsics": [[900, 0, 320], [0, 900, 240], [0, 0, 1]],
        "dist": [-0.2, 0.05, 0.001, -0.002, 0],
    }
    found = camera(path, lens, 640, 480)
    # normalized point; the Brown model written out
    x = 0.2
    y = -0.15
    k1, k2, p1, p2, _ = found.dist
    r2 = x * x + y * y
    q = 1 + k1 * r2 + k2 * r2 * r2
    seen = [
        x * q + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * q + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    ]
    pixels = np.array(seen) * 900 + [320, 240]
    expected = np.array([x, y]) * 900 + [320, 240]
    assert np.allclose(found.undistort(pixels[None]), expected, atol=0.05)


@pytest.mark.parametrize(
    ("given", "dist"),
    [
        ([[0.1, 0.2, 0, 0, 0.3]], [0.1, 0.2, 0, 0, 0.3]),
        ([[0.1], [0.2], [0], [0]], [0.1, 0.2, 0, 0, 0]),
        ([0.1, 0.2, 0, 0, 0.3, 0, 0, 0], [0.1, 0.2, 0, 0, 0.3]),
    ],
)
def test_nested_and_trailing_zero_coefficients(path, given, dist):
    assert camera(path, KNOWN | {"dist": given}).dist.tolist() == dist


@pytest.mark.parametrize(
    ("focal", "dist"),
    [
        (780, [-0.27, 0.1, 0.001, -0.002, -0.02]),  # an action camera
        (1400, [0.12, -0.3, 0, 0, 0.2]),
        (9000, [-0.5, 30, 0, 0, 900]),  # a long lens, whose radii are small
    ],
)
def test_real_lenses_are_accepted(path, focal, dist):
    content = {"intrinsics": [[focal, 0, 960], [0, focal, 540], [0, 0, 1]], "dist": dist}
    assert camera(path, content, 1920, 1080).dist.tolist() == dist


def test_other_proportions_are_refused(path):
    refused(
        path, KNOWN | {"size": [1920, 1080]}, "1920 x 1080.*576 x 576.*same camera mode", 576, 576
    )
    refused(path, KNOWN | {"size": [1920, 1080]}, "1920 x 1080.*1080 x 1920.*rotated", 1080, 1920)


@pytest.mark.parametrize("size", [(1280, 720), (1920, 1440)])
def test_a_lens_without_a_size_has_to_suit_that_of_the_footage(path, size):
    lens = {"intrinsics": [[1400, 0, 960], [0, 1400, 540], [0, 0, 1]]}
    assert camera(path, lens, 1920, 1080).intrinsics[0, 0] == 1400
    refused(path, lens, r'principal point \(960, 540\).*"size"', *size)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"intrinsics": [[1000, 0, 500], [0, 1100, 300], [0, 0, 0]]}, "must be"),
        ({"intrinsics": [[1000, 0, 500], [3, 1100, 300], [0, 0, 1]]}, "must be"),
        ({"intrinsics": [[1000, 40, 500], [0, 1100, 300], [0, 0, 1]]}, "skew"),
        ({"intrinsics": [[0, 0, 0], [0, 0, 0], [0, 0, 1]]}, "above 0"),
        ({"intrinsics": [[0.9, 0, 0.5], [0, 0.9, 0.5], [0, 0, 1]]}, "in pixels"),
        ({"intrinsics": [[10000, 0, 500], [0, 1100, 300], [0, 0, 1]]}, "differ too much"),
        ({"intrinsics": [[1000, 0, 1e300], [0, 1100, 300], [0, 0, 1]]}, "too far"),
        ({"intrinsics": [[1e300, 0, 500], [0, 1100, 300], [0, 0, 1]]}, "no lens"),
        ({"intrinsics": [[1000, 0, float("nan")], [0, 1100, 300], [0, 0, 1]]}, "three numbers"),
        ({"intrinsics": [["a"]]}, "three numbers"),
        ({"intrinsics": [[10**400, 0, 500], [0, 1100, 300], [0, 0, 1]]}, "401 digits"),
        ({"dist": [0.1, 0.2, 0, 0, 0.3, 0.1, 0, 0]}, "8 numbers.*undistort"),
        ({"dist": [[0.1, 0], [0, 0]]}, "list of numbers"),
        ({"dist": ["much"]}, "list of numbers"),
        ({"dist": [-1e300, 1e300]}, "folds or tears"),
        ({"dist": [-5, 2]}, "folds or tears"),
        ({"dist": [0, 0, 0.9, 0]}, "folds or tears"),
        ({"distortion": [0.1]}, "twice, as dist and distortion"),
        ({"k1": 0.1}, "'k1' is unknown"),
        ({"camera_model": "fisheye"}, "'camera_model' is unknown"),
        ({"resolution": [1000, 600]}, "'resolution' is unknown"),
        ({"size": [float("nan"), 576]}, "size must be"),
        ({"size": [1e200, 1e200]}, "size must be"),
        ({"size": {"0": 1000}}, "size must be"),
    ],
)
def test_impossible_values_are_refused(path, changed, message):
    refused(path, KNOWN | changed, message)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"K":' * 100_000, "9" * 9999])
def test_other_files_are_refused_by_name(path, text):
    refused(path, text, re.escape(f"{path} is not a calibration"))


def take(tmp_path, *names):
    """Return a TOML file of cameras that differ in their focal length and place."""
    lines = []
    for k, name in enumerate(names):
        lines += [
            f'[{name}]\nname = "{name}"\nsize = [1000.0, 600.0]\nfisheye = false',
            f"matrix = [[{1000 + k}.0, 0.0, 500.0], [0.0, 1100.0, 300.0], [0.0, 0.0, 1.0]]",
            f"distortions = [0.1, 0.0, 0.0, 0.0]\nrotation = [0.0, {k}.0, 0.0]",
            f"translation = [{k}.0, 0.0, 4.0]",
        ]
    path = tmp_path / "calib.toml"
    path.write_text("\n".join(lines) + "\n[metadata]\nerror = 0.0\n", "utf-8")
    return path


def test_cameras_belong_to_the_videos_of_the_same_names(tmp_path):
    path = take(tmp_path, "cam_01", "cam_02", "cam_03")
    found = placed_cameras(path, ["Cam03", "cam-01"])
    assert [str(file).rpartition("#")[2] for file, _ in found] == ["cam_03", "cam_01"]
    third, first = (T for _, T in found)
    np.testing.assert_allclose(third[:3, 3], [2, 0, 4])
    np.testing.assert_allclose(
        third[:3, :3],
        [[np.cos(2), 0, np.sin(2)], [0, 1, 0], [-np.sin(2), 0, np.cos(2)]],
        atol=1e-12,
    )
    np.testing.assert_allclose(first[:3, :3], np.eye(3))
    assert read_calibration(found[0][0]).intrinsics[0, 0] == 1002


def test_cameras_of_other_names_belong_to_the_videos_in_their_order(tmp_path):
    path = take(tmp_path, "a", "b")
    found = placed_cameras(path, ["left", "right"])
    assert [str(file).rpartition("#")[2] for file, _ in found] == ["a", "b"]
    with pytest.raises(InputError, match="cameras a, b, which are not the names of the 3 videos"):
        placed_cameras(path, ["left", "right", "top"])


def test_one_lens_is_that_of_all_cameras(tmp_path, path):
    path.write_text(json.dumps(KNOWN))
    assert placed_cameras(path, ["left", "right"]) == [(path, None)] * 2
    several = take(tmp_path, "a", "b")
    named = Path(f"{several}#b")
    assert placed_cameras(named, ["left", "right"]) == [(named, None)] * 2


def test_a_place_that_is_none_is_refused(tmp_path):
    path = take(tmp_path, "a", "b")
    path.write_text(path.read_text().replace("translation = [1.0, 0.0, 4.0]", "translation = [1]"))
    with pytest.raises(InputError, match="rotation and translation of b"):
        placed_cameras(path, ["a", "b"])


def saved(tmp_path, sources, frames=1, **more):
    """Save the cameras of a motion, whose videos have these names; return the motion, too."""
    body = load_body("scope")
    views = made_views(*[0.5] * len(sources[1:])) | {
        "view_sources": np.array([f"{name}.mp4" for name in sources[1:]])
    }
    poses = np.zeros((frames, 3 * (body.K + 1)))
    views |= more.pop("views", {})
    motion = made_motion(body, poses, np.zeros((frames, 3)), views=views, **more)
    motion.source = f"{sources[0]}.mp4"
    path = tmp_path / "found.toml"
    write_calibration(path, motion)
    return path, motion


def test_saved_cameras_have_names_of_their_own(tmp_path):
    path, _ = saved(tmp_path, ["walk", "walk_3", "walk"])
    names = [file.name for file, _ in placed_cameras(path, ["a", "b", "c"])]
    assert names == ["found.toml#walk", "found.toml#walk_3", "found.toml#walk_3_3"]


@pytest.mark.parametrize("rotation", [0, 90, 180, 270])
def test_saved_cameras_are_read_again_as_they_were(tmp_path, rotation):
    T = np.eye(4)
    T[:3, :3] = exp(np.array([0.2, 1.1, -0.3]))
    T[:3, 3] = [-3.0, 0.4, 2.0]
    views = {
        "view_from_camera": T[None],
        "view_dist": np.array([[0.1, -0.05, 0.003, -0.002, 0.01]]),
    }
    path, motion = saved(
        tmp_path,
        ["walk", "walk2"],
        frames=2,
        views=views,
        footage_rotation=rotation,
        dist=[0.1, 0, 0, 0, 0],
    )
    found = placed_cameras(path, ["walk", "walk2"])
    seen = motion, motion.from_view(0)
    view = motion.view
    places = []
    for (file, T_camera_world), each in zip(found, seen, strict=True):
        size = each.image_size.tolist()
        again = choose_camera(*size, calibration=file, view=view)
        np.testing.assert_allclose(again.intrinsics, each.intrinsics, atol=1e-9)
        np.testing.assert_allclose(again.dist, each.dist, atol=1e-12)
        turned = T_camera_world.copy()
        turned[:3] = view.axes @ turned[:3]
        places.append(turned)
        np.testing.assert_allclose(np.linalg.inv(turned), each.world_from_camera[0], atol=1e-9)
    np.testing.assert_allclose(places[1] @ np.linalg.inv(places[0]), T, atol=1e-9)


def test_the_error_is_that_of_frames_in_which_the_camera_saw_the_person(tmp_path):
    path, _ = saved(tmp_path, ["walk"], frames=4, residual_px=np.array([0.0, 3.0, 0.0, 5.0]))
    assert "error = 4.0\n" in path.read_text()


def test_axes_turn_as_the_picture_does():
    """A point's pixel in the turned picture is its projection in the turned axes."""
    point = np.array([0.3, -0.2, 2.0])
    for degrees in (0, 90, 180, 270):
        view = FootageView(degrees)
        pixel = (np.array(K, float) @ point)[:2] / 2.0
        width, height = 1000, 600
        for _ in range(degrees // 90):
            pixel = np.array([height - 1 - pixel[1], pixel[0]])
            width, height = height, width
        turned = view.intrinsics(np.array(K, float), 1000, 600) @ view.axes @ point
        np.testing.assert_allclose(turned[:2] / turned[2], pixel)


@pytest.mark.parametrize(
    "name", ["\U0001f3ac", "metadata", "caf\udce9", "a#b", 'a"b\\', "a\nb\x1b"]
)
def test_cameras_are_saved_whatever_the_names_of_their_videos(tmp_path, name):
    path, _ = saved(tmp_path, [name, "caf\ufffd"])
    found = placed_cameras(path, [name, "caf\ufffd"])
    lenses = [read_calibration(file).intrinsics[0, 0] for file, _ in found]
    assert lenses == [600.0, 500.0]
