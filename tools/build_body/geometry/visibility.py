# SPDX-License-Identifier: GPL-3.0-or-later
"""Which faces can be seen from outside: a depth buffer from many directions all around."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

DIRECTIONS = 96
PIXEL = 0.0007  # metres


def seen_from_outside(
    vertices: NDArray[np.float64], triangles: NDArray[np.intp], occluders: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Return (T,) bool: whether the triangle's front is visible in at least one pixel from one
    direction.

    :param vertices: (N, 3) metres.
    :param triangles: (T, 3), counter-clockwise from outside.
    :param occluders: (O, 3) further triangles that only occlude.
    """
    corners = vertices[np.concatenate([triangles, occluders])]
    seen = np.zeros(len(corners), bool)
    for direction in _sphere(DIRECTIONS):
        side = np.cross(direction, [0.0, 0.0, 1.0] if abs(direction[1]) > 0.9 else [0.0, 1.0, 0.0])
        side /= np.linalg.norm(side)
        # rows: image x, image y, towards the eye
        frame = np.stack([side, np.cross(direction, side), direction])
        projected = corners @ frame.T
        projected[:, :, :2] = (projected[:, :, :2] - projected[:, :, :2].min(axis=(0, 1))) / PIXEL
        width, height = (int(size) + 2 for size in projected[:, :, :2].max(axis=(0, 1)))
        depth = np.full((height, width), -np.inf)
        owner = np.full((height, width), -1)
        _draw(projected, depth, owner)
        seen[owner[owner >= 0]] = True
    return seen[: len(triangles)]


def _sphere(count: int) -> NDArray[np.float64]:
    """Return directions spread evenly over the sphere (the golden spiral)."""
    i = np.arange(count) + 0.5
    height = 1.0 - 2.0 * i / count
    turn = i * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - height**2)
    return np.stack([ring * np.cos(turn), height, ring * np.sin(turn)], axis=1)


@numba.njit(cache=False)
def _draw(corners, depth, owner):
    """Draw triangles (n, 3, 3) into a depth buffer; `owner` is the one at the front, or -1 where it
    shows its back.
    """
    for t in range(len(corners)):
        # unpacked rows compile slowly
        ax = corners[t, 0, 0]
        ay = corners[t, 0, 1]
        az = corners[t, 0, 2]
        bx = corners[t, 1, 0]
        by = corners[t, 1, 1]
        bz = corners[t, 1, 2]
        cx = corners[t, 2, 0]
        cy = corners[t, 2, 1]
        cz = corners[t, 2, 2]
        twice_area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if twice_area == 0.0:
            continue
        for y in range(int(np.ceil(min(ay, by, cy))), int(np.floor(max(ay, by, cy))) + 1):
            for x in range(int(np.ceil(min(ax, bx, cx))), int(np.floor(max(ax, bx, cx))) + 1):
                u = ((bx - x) * (cy - y) - (cx - x) * (by - y)) / twice_area
                v = ((cx - x) * (ay - y) - (ax - x) * (cy - y)) / twice_area
                if u < 0.0 or v < 0.0 or u + v > 1.0:
                    continue
                z = u * az + v * bz + (1.0 - u - v) * cz
                if z > depth[y, x]:
                    depth[y, x] = z
                    owner[y, x] = t if twice_area > 0.0 else -1
