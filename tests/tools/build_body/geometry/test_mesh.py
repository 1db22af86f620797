# SPDX-License-Identifier: GPL-3.0-or-later
"""Areas, edges and smooth fillings of meshes whose measures are known."""

from __future__ import annotations

import numpy as np
import pytest
from scope.tools.build_body.geometry.mesh import edges, split_quads, thin_plate, vertex_areas

from .quad_meshes import cube, grid, tube


@pytest.mark.parametrize(("mesh", "count"), [(cube(), 12), (grid(4, 3), 17), (tube(6, 3), 30)])
def test_every_edge_is_there_once(mesh: tuple[np.ndarray, np.ndarray], count: int) -> None:
    vertices, quads = mesh
    found = edges(quads)
    assert len(found) == len(np.unique(np.sort(found, axis=1), axis=0)) == count
    lengths = np.linalg.norm(vertices[found[:, 1]] - vertices[found[:, 0]], axis=1)
    assert np.ptp(lengths) < 1e-12  # no diagonals


def test_areas_of_vertices_add_up_to_the_surface() -> None:
    assert vertex_areas(*cube(2.0)).sum() == pytest.approx(24.0)
    assert vertex_areas(*grid(5, 4)).sum() == pytest.approx(12.0)


def test_triangles_wind_as_their_quads() -> None:
    vertices, quads = cube()
    a, b, c = vertices[split_quads(quads)].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    centres = (a + b + c) / 3
    assert (np.einsum("ti,ti->t", normals, centres) > 0).all()


def test_a_hole_in_a_plane_is_filled_with_the_plane_and_one_in_a_saddle_smoothly() -> None:
    vertices, quads = grid(9, 9)
    inside = np.array([y * 9 + x for y in (3, 4, 5) for x in (3, 4, 5)])
    slope = vertices.copy()
    slope[:, 2] = 0.3 * vertices[:, 0] - 0.2 * vertices[:, 1] + 1.0
    saddle = vertices.copy()
    # every vertex at the mean of its neighbours, as well
    saddle[:, 2] = (vertices[:, 0] - 4) * (vertices[:, 1] - 4)
    basis = np.stack([slope, saddle])
    damaged = basis.copy()
    damaged[:, inside] += 5.0
    np.testing.assert_allclose(
        thin_plate(edges(quads), inside, damaged), basis[:, inside], atol=1e-9
    )
