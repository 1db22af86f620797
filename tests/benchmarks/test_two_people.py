# SPDX-License-Identifier: GPL-3.0-or-later
"""The truth of two people: synthetic joints that four cameras see are found again, also with a
wrong keypoint.

Triangulation: points that were projected are found again, also where a camera is wrong.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scope.benchmarks.evaluation.metrics import aligned, similarity
from scope.benchmarks.two_people.accuracy import are_apart
from scope.benchmarks.two_people.footage import Camera
from scope.benchmarks.two_people.triangulation import (
    adjust_cameras,
    from_views,
    project,
    triangulate,
)
from scope.benchmarks.two_people.truth import pixels, solve
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


@pytest.mark.parametrize(("shift", "apart"), [(0.0, False), (90.0, False), (110.0, True)])
def test_people_are_apart_where_their_boxes_are(shift: float, apart: bool) -> None:
    points = np.random.default_rng(2).uniform(0, 100, (12, 2))
    points[:2] = [[0, 0], [100, 100]]
    points[5] = np.nan
    assert are_apart(points, points + [shift, 0]) == apart
    assert are_apart(points, points - [0, shift]) == apart


FOCAL_PX = np.array([1600.0, 1700.0, 1500.0, 1650.0])


def _cameras_around() -> NDArray[np.float64]:
    """Four cameras 4 m from the origin, a quarter turn apart, each looking at it."""
    T = np.tile(np.eye(4), (4, 1, 1))
    for k in range(4):
        T[k, :3, :3] = exp(np.array([0.0, k * np.pi / 2 + 0.2, 0.0]))
        T[k, 2, 3] = 4.0
    return T


@pytest.fixture
def points() -> NDArray[np.float64]:
    return np.random.default_rng(3).uniform(-0.9, 0.9, (50, 3))


def test_projected_points_are_found(points: NDArray[np.float64]) -> None:
    x = project(points, _cameras_around())
    np.testing.assert_allclose(from_views(x, _cameras_around()), points, atol=1e-9)
    found = triangulate(x, np.ones(x.shape[:2]), _cameras_around(), FOCAL_PX)
    np.testing.assert_allclose(found.points, points, atol=1e-6)
    assert found.good.all()


def test_projection_by_hand() -> None:
    np.testing.assert_allclose(
        project(np.array([[0.5, -1.0, 2.0]]), np.eye(4)[None]), [[[0.25, -0.5]]]
    )


def test_a_wrong_camera_is_left_out(points: NDArray[np.float64]) -> None:
    x = project(points, _cameras_around())
    wrong = np.arange(len(points)) % 4
    x[wrong, np.arange(len(points))] += 0.2  # some 300 pixels: a keypoint on another person
    found = triangulate(x, np.ones(x.shape[:2]), _cameras_around(), FOCAL_PX)
    np.testing.assert_allclose(found.points, points, atol=2e-4)
    expected = np.ones(x.shape[:2], bool)
    expected[wrong, np.arange(len(points))] = False
    np.testing.assert_array_equal(found.good, expected)


def test_cameras_that_are_slightly_wrong_are_corrected(points: NDArray[np.float64]) -> None:
    """The same shape is found, whatever the correction that all cameras share, to the scale that
    the start gives.
    """
    true = _cameras_around()
    x = project(points, _cameras_around())
    moved = true.copy()
    rng = np.random.default_rng(5)
    for k in range(4):
        turned = np.eye(4)
        turned[:3, :3] = exp(np.radians(1.0) * rng.normal(size=3))
        turned[:3, 3] = 0.03 * rng.normal(size=3)
        moved[k] = turned @ true[k]
    wrong = triangulate(x, np.ones(x.shape[:2]), moved, FOCAL_PX)
    assert np.nanmedian(wrong.error_px) > 5.0
    T = adjust_cameras(x, np.ones(x.shape[:2]), moved, FOCAL_PX, np.radians(2.0), 0.1)
    found = triangulate(x, np.ones(x.shape[:2]), T, FOCAL_PX)
    assert np.median(found.error_px) < 1.0  # fifty points weigh little against the prior
    scale, *_ = transform = similarity(found.points, points)
    assert scale == pytest.approx(1.0, abs=0.02)
    np.testing.assert_allclose(aligned(found.points, transform), points, atol=6e-3)
