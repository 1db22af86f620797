# SPDX-License-Identifier: GPL-3.0-or-later
"""Turned and mirrored footage: the lens that goes with it, by OpenCV's projection of points."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scope.scope_addon.footage_view import AS_IN_FILE, FootageView

VIEWS = [FootageView(turn, mirrored) for turn in (0, 90, 180, 270) for mirrored in (False, True)]
K = np.array([[700.0, 0, 310.0], [0, 720.0, 190.0], [0, 0, 1]])
DIST = np.array([-0.1, 0.02, 0.004, -0.003, 0.01])
WIDTH, HEIGHT = 640, 400


def seen_by(view: FootageView, points: np.ndarray) -> np.ndarray:
    """Points of the camera (N, 3) in the axes of a camera that saw the turned picture."""
    shown = points.copy()
    for _ in range(view.clockwise_deg // 90):
        shown = np.stack([-shown[:, 1], shown[:, 0], shown[:, 2]], axis=1)
    return shown * [-1, 1, 1] if view.is_mirrored else shown


@pytest.mark.parametrize("view", VIEWS)
def test_the_lens_of_the_shown_picture_puts_points_where_they_are_shown(view: FootageView) -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform([-0.3, -0.2, 1], [0.3, 0.2, 2], (20, 3))
    in_file = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, DIST)[0][:, 0]
    shown_lens = view.intrinsics(K, WIDTH, HEIGHT), view.distortion(DIST)
    shown = cv2.projectPoints(seen_by(view, points), np.zeros(3), np.zeros(3), *shown_lens)[0][:, 0]
    for (x, y), (u, v) in zip(np.round(in_file).astype(int), shown, strict=True):
        image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
        image[y, x] = 255
        row, column = np.argwhere(view.show(image)[..., 0])[0]
        assert abs(column - u) < 0.51
        assert abs(row - v) < 0.51


@pytest.mark.parametrize("view", VIEWS)
def test_the_inverse_gives_the_picture_and_the_lens_of_the_file_back(view: FootageView) -> None:
    image = np.random.default_rng(1).integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)
    shown = view.show(image)
    assert shown.shape[1::-1] == view.size(WIDTH, HEIGHT)
    np.testing.assert_array_equal(view.inverse.show(shown), image)
    size = view.size(WIDTH, HEIGHT)
    np.testing.assert_allclose(view.inverse.intrinsics(view.intrinsics(K, WIDTH, HEIGHT), *size), K)
    np.testing.assert_allclose(view.inverse.distortion(view.distortion(DIST)), DIST)


@pytest.mark.parametrize("later", VIEWS)
@pytest.mark.parametrize("view", VIEWS)
def test_two_views_are_one(view: FootageView, later: FootageView) -> None:
    image = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    np.testing.assert_array_equal(view.then(later).show(image), later.show(view.show(image)))


def test_footage_as_in_its_file_is_not_copied() -> None:
    image = np.zeros((4, 6, 3), np.uint8)
    assert AS_IN_FILE.show(image) is image
