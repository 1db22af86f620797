# SPDX-License-Identifier: GPL-3.0-or-later
"""YOLOv8, YOLO11 and similar: one output (1, 4 + classes, N), a column per box.

A column is the box's centre x, y, width and height in pixels of the network's input, and a score for each class. Rows
after the classes (the keypoints of a pose network) are ignored.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from ..description import Description
from ..graph import UNIT, Graph, finite
from .boxes import Boxes, corners_of

TYPE = "yolov8"
NORMALIZATION = UNIT
CENTERED, STRETCHED = True, False


def matches(graph: Graph) -> bool:
    """Check for one output with a column for every cell of the grids of 8, 16 and 32 pixels."""
    if len(graph.shapes) != 1 or len(graph.shapes[0]) != 3:
        return False
    _, numbers, boxes = graph.shapes[0]
    return numbers >= 5 and boxes == sum((graph.width // s) * (graph.height // s) for s in (8, 16, 32))


def decode(outputs: list[NDArray[Any]], graph: Graph, description: Description) -> Boxes:
    """Read the boxes of people, in pixels of the network's input.

    :param outputs: one, (1, 4 + C, N) for C classes; see the module.
    """
    columns = finite(outputs[0])[0]
    return Boxes(corners_of(columns[:4].T), columns[4 + description.person_class])
