# SPDX-License-Identifier: GPL-3.0-or-later
"""Three orthogonal directions from edges that are projected exactly, with others among them."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.camera.line_segments import Lines, Segments
from scope.scope_addon.capture.camera.manhattan import EDGE_SIGMA, Edges, line_normal_equations
from scope.solver.rotations import exp

WIDTH = 1280
HEIGHT = 720
FOCAL_PX = 1000.0


def edges_of(R_camera_room: np.ndarray, seed: int, others: int) -> Edges:
    """Return the edges of a room, 20 along each of its axes, and some in other directions."""
    rng = np.random.default_rng(seed)
    ends: list[np.ndarray] = []
    while len(ends) < 60 + others:
        a = rng.uniform([-4, -2, -3], [4, 2, 3])
        step = (
            np.eye(3)[len(ends) // 20] * rng.uniform(1, 3)
            if len(ends) < 60
            else rng.uniform(-1, 1, 3)
        )
        points = np.stack([a, a + step]) @ R_camera_room.T + [0, 0, 8.0]
        if points[:, 2].min() > 0.5:
            ends.append(FOCAL_PX * points[:, :2] / points[:, 2:] + [WIDTH / 2, HEIGHT / 2])
    lengths = np.linalg.norm(np.diff(ends, axis=1)[:, 0], axis=1) / WIDTH
    order = np.argsort(-lengths)
    return Edges.of(Segments(np.array(ends)[order], lengths[order]), WIDTH, HEIGHT)


@pytest.mark.parametrize(
    ("turn", "others"), [((0.1, 0.6, 0.05), 0), ((-0.3, -0.4, -0.1), 30), ((0.2, 0.3, 0.2), 30)]
)
def test_the_axes_of_a_room_are_found(turn: tuple[float, float, float], others: int) -> None:
    R = exp(np.array(turn))
    edges = edges_of(R, 2, others)
    explained, axes = edges.axes(FOCAL_PX)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-5)
    agreement = np.abs(axes @ R)
    assert agreement[0, 1] > np.cos(np.radians(0.3))  # up is the room's y axis
    # and each axis is one of the three
    assert agreement.max(axis=0).min() > np.cos(np.radians(0.5))
    assert explained == pytest.approx(edges.support(FOCAL_PX))


def test_the_true_focal_length_explains_most() -> None:
    edges = edges_of(exp(np.array([0.15, 0.6, 0.05])), 5, others=10)
    support = {factor: edges.support(factor * FOCAL_PX) for factor in (0.6, 0.8, 1.0, 1.25, 1.6)}
    assert max(support, key=lambda factor: support[factor]) == 1.0


def test_each_edge_counts_as_far_as_it_points_at_the_nearest_vanishing_point() -> None:
    edges = edges_of(exp(np.array([0.1, 0.6, 0.05])), 3, others=40)
    explained, axes = edges.axes(FOCAL_PX)
    expected = 0.0
    for middle, along, weight in zip(edges.middle, edges.along, edges.weight, strict=True):
        to_points = [FOCAL_PX * d[:2] - d[2] * middle for d in axes]
        sines = [(x * along[1] - y * along[0]) / np.hypot(x, y) for x, y in to_points]
        expected += weight * max(np.exp(-0.5 * (sine / EDGE_SIGMA) ** 2) for sine in sines)
    assert explained == pytest.approx(expected, rel=1e-4)


def test_steps_lead_to_the_directions_of_the_lines() -> None:
    rng = np.random.default_rng(7)
    true = exp(rng.normal(size=3))
    normals = np.cross(true[np.arange(60) % 3], rng.normal(size=(60, 3)))
    lines = Lines(
        normals / np.linalg.norm(normals, axis=1, keepdims=True), rng.uniform(0.1, 0.5, 60)
    )
    found = np.asarray(true @ exp(np.array([0.02, -0.03, 0.015])).T, np.float64)
    supports = np.zeros(3)
    for _ in range(8):
        H, g, supports = line_normal_equations(lines, found, sigma=0.05)
        found = found @ exp(np.linalg.solve(H, g)).T
    np.testing.assert_allclose(found, true, atol=1e-7)
    np.testing.assert_allclose(supports.sum(), lines.lengths.sum())
