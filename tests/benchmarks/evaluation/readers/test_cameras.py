# SPDX-License-Identifier: GPL-3.0-or-later
"""Intrinsics come back from projected points."""

import numpy as np
from scope.benchmarks.evaluation.readers.cameras import intrinsics_of_projection

K = np.array([[1145.0, 0, 512.5], [0, 1143.8, 515.4], [0, 0, 1]])


def test_the_camera_of_projected_points_is_found():
    points = np.random.default_rng(0).normal(size=(20, 17, 3)) + [0, 0, 4]
    points[0, 0] = [0.1, 0.2, -1.0]  # behind the camera
    pixels = (points @ K.T)[..., :2] / points[..., 2:]
    pixels[0, 0] = 1e6
    assert np.allclose(intrinsics_of_projection(points, pixels), K)
