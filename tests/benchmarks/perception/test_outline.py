# SPDX-License-Identifier: GPL-3.0-or-later
"""The measure of silhouettes: figures by hand, and a body drawn into a rotated region where its
projection lies.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scope.benchmarks.perception.outline import overlap, silhouette
from scope.scope_addon.capture.perception.region import Region
from scope.solver import Body


def test_figures_of_two_rectangles() -> None:
    """The body covers 6 x 4 pixels, the mask 6 x 8, of which 2 columns lie outside the image; 12
    are common.
    """
    shape = np.ones((256, 256), np.uint8)
    mask = np.zeros((256, 256), bool)
    shape[10:16, 20:24] = 2
    mask[10:16, 22:30] = True
    shape[:, 28:] = 0
    found = overlap(shape, mask)
    assert found == pytest.approx(
        {"iou": 12 / (24 + 36 - 12), "body_outside": 0.5, "mask_outside": 1 - 12 / 36}
    )
    assert overlap(shape, np.zeros_like(mask)) is None


def test_a_body_fills_the_region_where_it_projects_to(body: Body) -> None:
    """By OpenCV's projection of the vertices: all lie inside the silhouette, up to a pixel, and it
    is no larger.
    """
    T = np.array([0.2, 0.1, 2.9])
    betas = np.zeros(body.P)
    turn = np.diag([1.0, -1.0, -1.0])
    dist = np.array([-0.1, 0.02, 0.001, 0.001, 0.0])
    vertices = (body.rest_vertices(betas) - body.rest_joints(betas)[0]) @ turn.T + T
    K = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]])
    pixels = cv2.projectPoints(vertices, np.zeros(3), np.zeros(3), K, dist)[0][:, 0]
    region = Region((330.0, 250.0), 820.0, 0.3)
    shape = silhouette(body, vertices, K, dist, (640, 480), region)
    at = np.rint(region.crop_from_image(pixels.astype(np.float64)) * 256 - 0.5).astype(np.int32)
    inside = (
        (pixels > 1).all(axis=1)
        & (pixels < (638, 478)).all(axis=1)
        & (at > 0).all(axis=1)
        & (at < 255).all(axis=1)
    )
    grown = cv2.dilate((shape == 2).astype(np.uint8), np.ones((3, 3), np.uint8))
    assert grown[at[inside, 1], at[inside, 0]].all()
    hull = np.zeros((256, 256), np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(at), (1,))
    assert not ((shape == 2) & (cv2.dilate(hull, np.ones((3, 3), np.uint8)) == 0)).any()
    # left of the image, and inside it beside the body
    left = np.array([[-30.0, 240.0], [60.0, 240.0]])
    (out_x, out_y), (in_x, in_y) = np.rint(region.crop_from_image(left) * 256 - 0.5).astype(int)
    assert 0 <= out_x < 256
    assert (shape[out_y, out_x], shape[in_y, in_x]) == (0, 1)
