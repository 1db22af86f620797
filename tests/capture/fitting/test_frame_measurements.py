# SPDX-License-Identifier: GPL-3.0-or-later
"""The position of lifted points in the camera, against the module's least-squares problem."""

import numpy as np
from scope.scope_addon.capture.fitting.frame_measurements import place


def test_contradicting_points_are_weighted_by_confidence():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(33, 3))
    rays = rng.normal(scale=0.2, size=(33, 2))
    confidence = rng.uniform(size=33)

    def cost(t):
        moved = points + t
        return (confidence * np.square(moved[:, :2] - rays * moved[:, 2:]).sum(axis=1)).sum()

    found = place(points, rays, confidence)
    for way in np.concatenate([np.eye(3), -np.eye(3)]):
        assert cost(found + 1e-3 * way) > cost(found)
