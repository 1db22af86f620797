# SPDX-License-Identifier: GPL-3.0-or-later
"""Quad meshes of known shape: a tube, a cube and a grid."""

from __future__ import annotations

import numpy as np


def tube(around: int, rings: int) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and quads of an open tube of radius 1 along z, one unit a ring."""
    angle = 2 * np.pi * np.arange(around) / around
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = np.array([[*xy, z] for z in range(rings) for xy in circle])
    quads = [
        (
            z * around + k,
            z * around + (k + 1) % around,
            (z + 1) * around + (k + 1) % around,
            (z + 1) * around + k,
        )
        for z in range(rings - 1)
        for k in range(around)
    ]
    return vertices, np.array(quads)


def grid(columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and quads of a flat grid of unit squares."""
    vertices = np.array([(x, y, 0.0) for y in range(rows) for x in range(columns)])
    corner = np.array([y * columns + x for y in range(rows - 1) for x in range(columns - 1)])
    return vertices, np.stack([corner, corner + 1, corner + columns + 1, corner + columns], axis=1)


def cube(side: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and quads of a cube about the origin, counter-clockwise from outside."""
    vertices = side * (np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]) - 0.5)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return vertices, np.array(quads)
