# SPDX-License-Identifier: GPL-3.0-or-later
"""Edge loops of a tube and of a grid, whose loops are known."""

from __future__ import annotations

import numpy as np
import pytest
from scope.tools.build_body.geometry.loops import QuadLoops

from .quad_meshes import cube, grid, tube

AROUND = 10
RINGS = 7
VERTICES, QUADS = tube(AROUND, RINGS)


def test_a_loop_goes_once_around_the_tube() -> None:
    loops = QuadLoops(QUADS)
    assert loops.walk(3 * AROUND, 3 * AROUND + 1) == [3 * AROUND + k for k in range(AROUND)]
    assert loops.walk(3 * AROUND + 1, 3 * AROUND) == [
        3 * AROUND + (1 - k) % AROUND for k in range(AROUND)
    ]


def test_a_path_that_meets_a_border_or_a_pole_is_no_loop() -> None:
    assert QuadLoops(QUADS).walk(2 * AROUND, 3 * AROUND) is None  # along the tube, to its end
    assert QuadLoops(grid(5, 5)[1]).walk(12, 13) is None
    assert QuadLoops(cube()[1]).walk(0, 1) is None  # three quads at every corner


@pytest.mark.parametrize("height", [1.2, 2.9, 4.4])
def test_the_loop_nearest_to_a_plane(height: float) -> None:
    scaled = 0.02 * VERTICES  # rings two centimetres apart
    point = np.array([0.0, 0.0, 0.02 * height])
    up = np.array([0.0, 0.0, 1.0])
    loop = QuadLoops(QUADS).nearest(scaled, point, up, radius=0.1)
    assert sorted(loop) == [round(height) * AROUND + k for k in range(AROUND)]
    with pytest.raises(ValueError, match="no closed edge loop"):
        QuadLoops(QUADS).nearest(scaled, point + [1.0, 0.0, 0.0], up, radius=0.1)


def test_faces_beyond_a_loop() -> None:
    loops = QuadLoops(QUADS)
    loop = [3 * AROUND + k for k in range(AROUND)]
    below = np.arange(len(QUADS)) < 3 * AROUND
    np.testing.assert_array_equal(loops.beyond(loop, 0), below)
    np.testing.assert_array_equal(loops.beyond(loop, len(QUADS) - 1), ~below)
