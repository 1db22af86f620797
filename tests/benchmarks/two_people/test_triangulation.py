# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangulation: points that were projected are found again, also where a camera is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scope.benchmarks.evaluation.metrics import aligned, similarity
from scope.benchmarks.two_people.triangulation import (
    adjust_cameras,
    from_views,
    project,
    triangulate,
)
from scope.solver.rotations import exp

FOCAL_PX = np.array([1600.0, 1700.0, 1500.0, 1650.0])


def _cameras() -> NDArray[np.float64]:
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
    x = project(points, _cameras())
    np.testing.assert_allclose(from_views(x, _cameras()), points, atol=1e-9)
    found = triangulate(x, np.ones(x.shape[:2]), _cameras(), FOCAL_PX)
    np.testing.assert_allclose(found.points, points, atol=1e-6)
    assert found.good.all()


def test_projection_by_hand() -> None:
    np.testing.assert_allclose(
        project(np.array([[0.5, -1.0, 2.0]]), np.eye(4)[None]), [[[0.25, -0.5]]]
    )


def test_a_wrong_camera_is_left_out(points: NDArray[np.float64]) -> None:
    x = project(points, _cameras())
    wrong = np.arange(len(points)) % 4
    x[wrong, np.arange(len(points))] += 0.2  # some 300 pixels: a keypoint on another person
    found = triangulate(x, np.ones(x.shape[:2]), _cameras(), FOCAL_PX)
    np.testing.assert_allclose(found.points, points, atol=2e-4)
    expected = np.ones(x.shape[:2], bool)
    expected[wrong, np.arange(len(points))] = False
    np.testing.assert_array_equal(found.good, expected)


def test_cameras_that_are_slightly_wrong_are_corrected(points: NDArray[np.float64]) -> None:
    """The same shape is found, whatever the correction that all cameras share, to the scale that
    the start gives.
    """
    true = _cameras()
    x = project(points, _cameras())
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
