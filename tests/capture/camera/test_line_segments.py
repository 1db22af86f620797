# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight edges of drawn images: where they are, which are left out, and their planes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.camera.line_segments import Lines, Segments, find_segments
from scope.solver.rotations import exp

WIDTH = 800
HEIGHT = 600
LINES = [((100, 80), (620, 130)), ((150, 520), (700, 430)), ((400, 200), (410, 390))]


def drawn(scale: int = 1) -> np.ndarray:
    """Return an image with a dark band along each line, of which the line is one edge."""
    image = np.full((scale * HEIGHT, scale * WIDTH, 3), 200, np.uint8)
    for a, b in LINES:
        along = np.subtract(b, a) / np.linalg.norm(np.subtract(b, a))
        side = 30 * np.array([-along[1], along[0]])
        corners = scale * np.array([a, b, b + side, a + side])
        cv2.fillPoly(image, [np.round(16 * corners).astype(np.int32)], (40, 40, 40), cv2.LINE_AA, 4)
    return image


def distance(segment: np.ndarray, line: tuple[tuple[int, int], tuple[int, int]]) -> float:
    """Largest distance of a segment's ends from a line, pixels."""
    a, b = np.array(line, float)
    normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
    return float(np.abs((segment - a) @ normal).max())


@pytest.mark.parametrize("scale", [1, 3])
def test_drawn_lines_are_found_where_they_are(scale: int) -> None:
    """In an image that is larger than the working size as well."""
    found = find_segments(drawn(scale), [])
    assert (np.diff(found.lengths) <= 0).all()
    for line in LINES:
        on_it = [s / scale for s in found.ends_px if distance(s / scale, line) < 1.5]
        longest = max((np.linalg.norm(s[1] - s[0]) for s in on_it), default=0.0)
        assert longest > 0.9 * np.linalg.norm(np.subtract(*line))
    ends = found.ends_px[0]
    assert found.lengths[0] == pytest.approx(
        np.linalg.norm(ends[1] - ends[0]) / (scale * WIDTH), rel=1e-6
    )


def test_edges_on_people_and_at_bars_are_left_out() -> None:
    image = drawn()
    person = np.array([[360.0, 190.0], [430.0, 400.0]])
    around = find_segments(image, [person]).ends_px
    assert min(distance(s, LINES[2]) for s in around) > 10
    assert min(distance(s, LINES[0]) for s in around) < 1.5
    bar = np.array([0.0, 400.0, WIDTH, HEIGHT])
    without_bar = find_segments(image, [], bars=[bar]).ends_px
    assert min(distance(s, LINES[1]) for s in without_bar) > 10
    assert min(distance(s, LINES[0]) for s in without_bar) < 1.5


def test_the_plane_of_a_segment_contains_the_line_that_it_shows() -> None:
    camera = choose_camera(WIDTH, HEIGHT)
    a = np.array([-1.0, 0.4, 5.0])
    b = np.array([0.8, -0.5, 3.0])
    ends = np.stack([a, b]) @ camera.intrinsics.T
    lines = Segments((ends[:, :2] / ends[:, 2:])[None], np.array([0.4])).lines(camera)
    R = exp(np.array([0.1, 0.5, -0.2]))
    turned = lines.rotated(R)
    for share in (0.0, 0.3, 1.0):
        point = a + share * (b - a)
        assert lines.normals[0] @ point == pytest.approx(0.0, abs=1e-9)
        assert turned.normals[0] @ R @ point == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.norm(lines.normals[0]) == pytest.approx(1.0)
    np.testing.assert_array_equal(turned.lengths, lines.lengths)


def test_lines_of_the_same_pixels_with_another_focal_length() -> None:
    """The plane through the camera's centre and two pixels, by the rays of either lens."""
    rng = np.random.default_rng(0)
    pixels = rng.uniform(-500, 500, (20, 2, 2))

    def normals(focal_px: float) -> np.ndarray:
        rays = np.concatenate([pixels / focal_px, np.ones((20, 2, 1))], axis=2)
        across = np.cross(rays[:, 0], rays[:, 1])
        return across / np.linalg.norm(across, axis=1, keepdims=True)

    found = Lines(normals(1600.0), np.ones(20)).with_focal_scale(1300.0 / 1600.0)
    np.testing.assert_allclose(np.abs((found.normals * normals(1300.0)).sum(axis=1)), 1.0)
