# SPDX-License-Identifier: GPL-3.0-or-later
"""The truth of two people: synthetic joints that four cameras see are found again, also with a
wrong keypoint.
"""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scope.benchmarks.two_people import accuracy, footage
from scope.benchmarks.two_people.accuracy import True2D, are_apart, owner, region_around
from scope.benchmarks.two_people.footage import Camera, extract
from scope.benchmarks.two_people.truth import TruePerson, mirror, pixels, regions_of, save, solve
from scope.scope_addon.capture.perception.region import Region
from scope.solver.rotations import exp

DIST = np.array([-0.05, 0.14, 0.0006, 0.0007, 0.0])


def _cameras() -> dict[str, Camera]:
    """Four cameras 4 m from the origin that look at it, with a lens that distorts."""
    found = {}
    for k in range(4):
        T = np.eye(4)
        T[:3, :3] = exp(np.array([0.0, 0.3 + k * np.pi / 2, 0.0]))
        T[2, 3] = 4.0
        K = np.array([[1660.0 + 10 * k, 0, 540.0], [0, 1660.0, 960.0], [0, 0, 1]])
        found[f"cam{k + 1}"] = Camera(
            f"cam{k + 1}", K, DIST, T, (1088, 1920), np.array([0.0, -1.0, 0.0]), 0, 0.0
        )
    return found


def _joints() -> NDArray[np.float64]:
    """Return keypoints (3, 33, 3), metres, of a person standing at the origin in all three
    frames.
    """
    joints = np.random.default_rng(0).uniform([-0.3, -0.8, -0.3], [0.3, 0.8, 0.3], (3, 33, 3))
    joints[:, [11, 12], 1] = -0.5
    joints[:, [23, 24], 1] = 0.0
    return joints


def test_joints_are_found_again_through_distorting_lenses() -> None:
    cameras = _cameras()
    joints = _joints()
    seen = np.stack(
        [pixels(joints.reshape(-1, 3), camera).reshape(3, 33, 2) for camera in cameras.values()]
    )
    keypoints = np.concatenate([seen, np.ones((4, 3, 33, 1))], -1)
    keypoints[1, 0, 7, :2] += 400.0  # on another person
    found = solve(keypoints, cameras, adjusts=False)
    np.testing.assert_allclose(found.joints, joints, atol=5e-4)
    assert not found.found.good.reshape(4, 3, 33)[1, 0, 7]
    assert found.found.good.sum() == 4 * 3 * 33 - 1


def test_projection_agrees_with_opencv_and_keeps_what_is_not_known() -> None:
    camera = _cameras()["cam2"]
    points = _joints()[0]
    rotation = cv2.Rodrigues(camera.T_camera_world[:3, :3])[0]
    shift = camera.T_camera_world[:3, 3]
    expected = cv2.projectPoints(points, rotation, shift, camera.K, camera.dist)[0].reshape(-1, 2)
    points[3] = np.nan
    got = pixels(points, camera)
    assert np.isnan(got[3]).all()
    np.testing.assert_allclose(np.delete(got, 3, 0), np.delete(expected, 3, 0), atol=1e-6)


def test_regions_hold_everybody_also_where_joints_are_not_known() -> None:
    camera = _cameras()["cam1"]
    joints = _joints()
    joints[1, 24] = np.nan
    for region, points in zip(regions_of(joints, camera), joints, strict=True):
        inside = region.crop_from_image(pixels(points, camera))
        inside = inside[np.isfinite(inside).all(1)]
        assert ((inside > 0) & (inside < 1)).all()


def test_mirrored_regions_show_mirrored_pixels() -> None:
    image = np.random.default_rng(1).integers(0, 255, (300, 201, 3), np.uint8)
    image = np.asarray(cv2.GaussianBlur(image, (0, 0), 5.0), np.uint8)
    region = Region((80.0, 140.0), 120.0, 0.3)
    flipped = np.ascontiguousarray(image[:, ::-1])
    other = mirror(region, 201).cut(flipped, 64)[:, ::-1]
    np.testing.assert_allclose(other.astype(float), region.cut(image, 64).astype(float), atol=2.0)
    assert mirror(mirror(region, 201), 201) == region


@pytest.mark.parametrize(("shift", "apart"), [(0.0, False), (90.0, False), (110.0, True)])
def test_people_are_apart_where_their_boxes_are(shift: float, apart: bool) -> None:
    points = np.random.default_rng(2).uniform(0, 100, (12, 2))
    points[:2] = [[0, 0], [100, 100]]
    points[5] = np.nan
    assert are_apart(points, points + [shift, 0]) == apart
    assert are_apart(points, points - [0, shift]) == apart


def test_a_region_around_limbs_is_upright_with_the_trunk() -> None:
    points = np.array(
        [
            [-20, -50],
            [20, -50],
            [-30, -20],
            [30, -20],
            [-30, 0],
            [30, 0],
            [-10, 0],
            [10, 0],
            [-10, 40],
            [10, 40],
            [-10, 80],
            [10, 80],
        ],
        float,
    )
    region = region_around(points + np.full(2, 200.0))
    assert region.center_px == (200.0, 200.0)
    assert region.rotation == pytest.approx(0.0)
    assert region.side_px > 2 * 80


def test_a_person_who_is_never_compared_is_not_the_owner(monkeypatch: pytest.MonkeyPatch) -> None:
    off = {"man": np.full(3, np.nan), "woman": np.array([0.1, np.nan, 0.2])}
    monkeypatch.setattr(accuracy, "distances", lambda _, person, true: off[person])
    motion: Any = SimpleNamespace()
    true: True2D = dict.fromkeys(off, (np.arange(3), np.zeros((3, 12, 2))))
    assert owner(motion, true) == "woman"
    off["woman"][:] = np.nan
    assert owner(motion, true) is None


def test_an_interrupted_extraction_leaves_no_video(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The videos that exist are not extracted again: half a video would stay."""
    wheel = tmp_path / "a.whl"
    folder = tmp_path / "videos"
    with zipfile.ZipFile(wheel, "w") as archive:
        for k in range(1, 5):
            archive.writestr(f"Pose2Sim/Demo_MultiPerson/videos/cam0{k}.mp4", f"video {k}")
    monkeypatch.setattr(footage, "POSE2SIM", SimpleNamespace(fetch=lambda downloads: wheel))

    def interrupted(source: Any, target: Any) -> None:
        target.write(source.read(3))
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "copyfileobj", interrupted)
        with pytest.raises(KeyboardInterrupt):
            extract(folder, tmp_path)
    assert list(folder.iterdir()) == []
    assert [video.read_text("utf-8") for video in extract(folder, tmp_path).values()] == [
        f"video {k}" for k in range(1, 5)
    ]


def test_an_interrupted_write_leaves_the_truth_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cameras = _cameras()
    joints = _joints()
    nothing: Any = None
    save(tmp_path, "woman", TruePerson(joints, nothing, nothing, cameras))
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    with np.load(tmp_path / "woman_cam1.npz") as truth:
        assert sorted(truth) == sorted(
            ["joints", "names", "frame_index", "intrinsics", "dist", "fps", "size", "uv", "up"]
        )
        assert (float(truth["fps"]), truth["size"].tolist()) == (60.0, [1088, 1920])

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(np.lib.format, "write_array", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save(tmp_path, "woman", TruePerson(joints + 1.0, nothing, nothing, cameras))
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
