# SPDX-License-Identifier: GPL-3.0-or-later
"""The rasterizer against closed forms: ray-sphere and ray-plane depths, OpenCV's polygons and its
projection.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.fitting.rasterizer import (
    NEAR,
    Canvas,
    fill_silhouette,
    rasterize,
    vertex_normals,
)

WIDTH = 160
HEIGHT = 120
K = np.array([[150.0, 0.0, 80.5], [0.0, 140.0, 60.25], [0.0, 0.0, 1.0]])
RED = (1.0, 0.0, 0.0)


def sphere(center, radius: float, rows: int = 48) -> tuple[np.ndarray, np.ndarray]:
    """Create vertices and triangles, counter-clockwise seen from outside."""
    theta = np.linspace(0, np.pi, rows)
    phi = np.linspace(0, 2 * np.pi, 2 * rows, endpoint=False)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    points = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(2 * rows), indexing="ij")
    k = (j + 1) % (2 * rows)
    a, b, c, d = (r * 2 * rows + s for r, s in ((i, j), (i + 1, j), (i + 1, k), (i, k)))
    triangles = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    return np.asarray(center) + radius * points, triangles.astype(np.int32)


def rays() -> np.ndarray:
    """Calculate the viewing ray (H, W, 3) of each pixel centre with z = 1."""
    v, u = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    return np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones_like(u)], -1)


def sphere_depth(center, radius: float) -> np.ndarray:
    """Calculate z (H, W) of the nearer intersection of each pixel's ray with a sphere, inf where
    there is none.
    """
    d = rays()
    c = np.asarray(center)
    a = (d * d).sum(-1)
    b = d @ c
    inside = b * b - a * (c @ c - radius**2)
    return np.where(inside >= 0, (b - np.sqrt(np.maximum(inside, 0))) / a, np.inf)


def test_a_sphere_has_the_depth_and_outline_of_ray_casting():
    center = (0.2, -0.1, 3.0)
    radius = 0.7
    canvas = Canvas.blank(WIDTH, HEIGHT)
    rasterize(canvas, *sphere(center, radius), RED, K)
    expected = sphere_depth(center, radius)
    differ = canvas.coverage != np.isfinite(expected)
    assert differ.sum() < 0.02 * np.isfinite(expected).sum()
    well_inside = cv2.erode(np.isfinite(expected).astype(np.uint8), np.ones((5, 5))) > 0
    np.testing.assert_allclose(canvas.depth[well_inside], expected[well_inside], atol=6e-3)


def test_a_silhouette_covers_the_pixels_that_opencv_fills_but_for_their_edge():
    vertices, triangles = sphere((0.55, -0.1, 3.0), 0.7)  # beyond the right edge
    screen = np.ascontiguousarray((vertices / vertices[:, 2:] @ K.T)[:, :2])
    coverage = np.zeros((HEIGHT, WIDTH), np.bool_)
    fill_silhouette(coverage, screen, triangles)
    drawn = np.zeros((HEIGHT, WIDTH), np.uint8)
    for corners in screen[triangles]:
        cv2.fillConvexPoly(drawn, np.round(corners * 16).astype(np.int32), 1, shift=4)
    differ = coverage != drawn.astype(bool)
    edge = cv2.morphologyEx(drawn, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)).astype(bool)
    assert coverage.sum() > 2000
    assert not (differ & ~edge).any()
    screen[:, 0] = np.nan
    nothing = np.zeros_like(coverage)
    fill_silhouette(nothing, screen, triangles)
    assert not nothing.any()


def test_neighbouring_triangles_leave_no_gap_and_a_slanted_plane_is_exact():
    n = np.array([0.3, -0.4, -1.0])  # the plane n · p = -2
    uv = np.array([[20.0, 15.0], [140.0, 10.0], [150.0, 110.0], [10.0, 100.0], [77.7, 63.1]])
    d = np.stack([(uv[:, 0] - K[0, 2]) / K[0, 0], (uv[:, 1] - K[1, 2]) / K[1, 1], np.ones(5)], -1)
    points = d * (-2 / (d @ n))[:, None]
    fan = np.array([[4, 1, 0], [4, 2, 1], [4, 3, 2], [4, 0, 3]])
    canvas = Canvas.blank(WIDTH, HEIGHT)
    rasterize(canvas, points, fan, RED, K)
    outline = np.zeros((HEIGHT, WIDTH), np.uint8)
    cv2.fillConvexPoly(outline, np.round(uv[:4] * 256).astype(np.int32), 1, shift=8)
    inside = cv2.erode(outline, np.ones((3, 3))) > 0
    assert canvas.coverage[inside].all()
    np.testing.assert_allclose(canvas.depth[inside], (-2 / (rays() @ n))[inside], rtol=1e-5)


def test_a_floor_that_passes_under_the_camera_is_clipped_at_the_near_plane():
    y = 1.5
    floor = np.array([[-50, y, -20], [50, y, -20], [50, y, 60], [-50, y, 60.0]])
    canvas = Canvas.blank(WIDTH, HEIGHT)
    rasterize(canvas, floor, np.array([[0, 2, 1], [0, 3, 2]]), RED, K)
    if not canvas.coverage.any():
        rasterize(canvas, floor, np.array([[0, 1, 2], [0, 2, 3]]), RED, K)
    z = np.where(rays()[..., 1] > 0, y / np.maximum(rays()[..., 1], 1e-12), np.inf)
    z[(z > 60) | (np.abs(rays()[..., 0] * z) > 50)] = np.inf
    assert (canvas.coverage != np.isfinite(z)).mean() < 0.02
    both = canvas.coverage & np.isfinite(z)
    np.testing.assert_allclose(canvas.depth[both], z[both], rtol=1e-4)


def test_vertices_behind_the_camera_or_nan_are_not_drawn():
    points, triangles = sphere((0, 0, -3.0), 0.5)
    canvas = Canvas.blank(WIDTH, HEIGHT)
    rasterize(canvas, points, triangles, RED, K)
    rasterize(canvas, np.full_like(points, np.nan), triangles, RED, K)
    rasterize(canvas, points * 1e30, triangles, RED, K)
    assert not canvas.coverage.any()
    around = sphere((0, 0, 0.0), 2.0)[0]
    rasterize(canvas, around, triangles, RED, K)  # seen from within: all back faces
    assert not canvas.coverage.any()
    assert NEAR > 0


@pytest.mark.parametrize("dist", [[-0.25, 0.06, 0.002, -0.001, 0.01], [0.3]])
def test_distortion_agrees_with_opencv(dist):
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(30):
        center = rng.uniform([-0.9, -0.6, 2.5], [0.9, 0.6, 3.0])
        canvas = Canvas.blank(WIDTH, HEIGHT)
        rasterize(canvas, *sphere(center, 0.02, 12), RED, K, np.array(dist))
        lens = np.array(dist + [0.0] * (5 - len(dist)))
        pixel = cv2.projectPoints(center[None], np.zeros(3), np.zeros(3), K, lens)[0]
        v, u = np.nonzero(canvas.coverage)
        if 3 < pixel[0, 0, 0] < WIDTH - 4 and 3 < pixel[0, 0, 1] < HEIGHT - 4:
            inside += 1
            assert np.linalg.norm([u.mean() - pixel[0, 0, 0], v.mean() - pixel[0, 0, 1]]) < 0.5
    assert inside > 10


def test_points_far_outside_the_picture_do_not_fold_back_with_barrel_distortion():
    canvas = Canvas.blank(WIDTH, HEIGHT)
    # At x/z = 3 the radial polynomial is 3 (1 - 0.25·9) < 0: taken at its word it would land inside
    # the picture.
    rasterize(canvas, *sphere((6.0, 0.0, 2.0), 0.5), RED, K, np.array([-0.25, 0, 0, 0, 0]))
    assert not canvas.coverage.any()


def test_smooth_normals_of_a_sphere_point_outwards():
    points, triangles = sphere((1.0, 2.0, 3.0), 0.5)
    outward = (points - [1.0, 2.0, 3.0]) / 0.5
    middle = np.abs(outward[:, 2]) < 0.95
    cosine = (vertex_normals(points, triangles) * outward).sum(1)
    assert cosine[middle].min() > 0.999


def test_the_lit_side_is_brighter_and_opacity_is_written():
    points, triangles = sphere((0, 0, 3.0), 0.8)
    canvas = Canvas.blank(WIDTH, HEIGHT)
    rasterize(canvas, points, triangles, (0.5, 0.5, 0.5), K, opacity=0.25)
    assert set(np.unique(canvas.rgba[..., 3])) == {0, 64}
    # the light stands above the left shoulder
    assert canvas.rgba[45, 70, 0] > canvas.rgba[75, 95, 0] + 20
