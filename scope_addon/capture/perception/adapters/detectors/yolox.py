# SPDX-License-Identifier: GPL-3.0-or-later
"""YOLOX: one output (1, cells, 5 + classes), a row per cell of the grids of 8, 16 and 32 pixels.

A row is x, y, width, height, the probability of an object and one for each class; a score is the product of the two.
If undecoded, x and y are relative to the cell in units of its side, and width and height are logarithms:

    x = (x_raw + column) · side,  width = exp(width_raw) · side
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..description import Description
from ..graph import PIXELS_BGR, Graph, finite
from .boxes import Boxes, corners_of

TYPE = "yolox"
NORMALIZATION = PIXELS_BGR
CENTERED, STRETCHED = False, False
_SIDES = (8, 16, 32)
_LARGEST_LOGARITHM = 10.0


def matches(graph: Graph) -> bool:
    """Check for a row for every cell of the grids, with at least one class."""
    if len(graph.shapes) != 1 or len(graph.shapes[0]) != 3:
        return False
    _, rows, columns = graph.shapes[0]
    return rows == len(cells(graph.width, graph.height)) and columns >= 6


def is_decoded(graph: Graph) -> bool:
    """Check if boxes are in pixels: they then spread over the whole input, else over a few units."""
    return bool(np.abs(finite(graph.trial_outputs[0])[0, :, 0]).mean() > graph.width / 8)


def decode(outputs: list[NDArray[Any]], graph: Graph, description: Description, *, decoded: bool) -> Boxes:
    """Read the boxes of people, in pixels of the network's input.

    :param outputs: one, (1, N, 5 + C) for N cells and C classes; see the module.
    :param decoded: whether boxes are in pixels already.
    """
    rows = finite(outputs[0])[0]
    box = rows[:, :4]
    if not decoded:
        grid = cells(graph.width, graph.height)
        center = (box[:, :2] + grid[:, :2]) * grid[:, 2:]
        box = np.concatenate([center, np.exp(np.minimum(box[:, 2:], _LARGEST_LOGARITHM)) * grid[:, 2:]], axis=1)
    return Boxes(corners_of(box), rows[:, 4] * rows[:, 5 + description.person_class])


def cells(width: int, height: int) -> NDArray[np.float64]:
    """List column, row and side in pixels (N, 3) of every cell, in the order of the output's rows."""
    grids = []
    for side in _SIDES:
        row, column = np.meshgrid(np.arange(height // side), np.arange(width // side), indexing="ij")
        grids.append(np.stack([column, row, np.full(column.shape, side)], axis=-1).reshape(-1, 3))
    table: NDArray[np.float64] = np.concatenate(grids).astype(np.float64)
    return table
