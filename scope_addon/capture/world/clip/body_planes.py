# SPDX-License-Identifier: GPL-3.0-or-later
"""Tangent planes of the body's own surface as floors for forearms and hands."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .....solver import Floor

ENTERS_M = 0.01  # depth from which on an arm counts as inside the body
WEIGHT = 1.0  # of a point inside the body, against one of a sole under the floor that is surely in contact


def with_planes(
    floor: Floor | None, indices: NDArray[np.intp], normal: NDArray[np.float64], offset: NDArray[np.float64]
) -> Floor | None:
    """Add points that may not be below a plane each, and are free to be above it.

    :param floor: with one plane for all of its points, or None.
    :param indices: (n,) keypoints. :param normal, offset: (n, 3) unit, and (n,) metres, in the frame's camera.
    """
    count = len(indices)
    if not count:
        return floor
    free, inside = np.zeros(count), np.full(count, WEIGHT)
    if floor is None:
        return Floor(indices, normal, offset, free, below=inside)
    soles = len(np.asarray(floor.indices))

    def joined(first: Any, second: NDArray[Any], width: tuple[int, ...] = ()) -> NDArray[Any]:
        return np.concatenate([np.broadcast_to(first, (soles, *width)), second])

    return Floor(
        joined(floor.indices, indices), joined(floor.normal, normal, (3,)), joined(floor.offset, offset),
        joined(floor.contact, free), joined(1.0 if floor.below is None else floor.below, inside),
    )  # fmt: skip
