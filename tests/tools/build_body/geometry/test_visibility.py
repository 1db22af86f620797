# SPDX-License-Identifier: GPL-3.0-or-later
"""Which faces of nested and open boxes can be seen."""

from __future__ import annotations

import numpy as np
from scope.tools.build_body.geometry.mesh import split_quads
from scope.tools.build_body.geometry.visibility import seen_from_outside

from .quad_meshes import cube

SIDE_M = 0.06
VERTICES, QUADS = cube(SIDE_M)
BOX = split_quads(QUADS)
NONE = np.zeros((0, 3), int)


def test_the_outside_of_a_cube_is_seen_and_a_cube_in_it_is_not() -> None:
    both = np.concatenate([VERTICES, 0.5 * VERTICES])
    seen = seen_from_outside(both, np.concatenate([BOX, BOX + 8]), NONE)
    np.testing.assert_array_equal(seen, np.arange(24) < 12)


def test_the_inside_of_a_box_is_seen_through_its_open_top_alone() -> None:
    is_lid = np.isclose(VERTICES[BOX][:, :, 2], SIDE_M / 2).all(axis=1)
    walls = BOX[~is_lid]
    lid = BOX[is_lid]
    inside = walls[:, ::-1]  # their fronts face inwards
    assert seen_from_outside(VERTICES, inside, NONE).all()
    larger = np.concatenate([VERTICES, 1.2 * VERTICES])
    assert seen_from_outside(larger, inside, walls + 8).all()
    closed = seen_from_outside(larger, inside, np.concatenate([walls, lid]) + 8)
    assert len(closed) == len(inside)  # what only hides is no part of the answer
    assert not closed.any()


def test_the_back_of_a_sheet_is_not_seen() -> None:
    """A triangle that lies on a larger one shows its upper side alone."""
    sheet = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]) * SIDE_M
    both = np.concatenate([sheet, 5 * sheet - [0, 0, 1e-4]])
    assert seen_from_outside(both, np.array([[0, 1, 2]]), np.array([[3, 4, 5]])).all()
    assert not seen_from_outside(both, np.array([[2, 1, 0]]), np.array([[3, 4, 5]])).any()
