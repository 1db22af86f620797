# SPDX-License-Identifier: GPL-3.0-or-later
"""YOLOv8- and YOLO11-type: one output (1, 4 + classes, N), a column per box.

A column is the box's centre x, y, width and height in pixels of the network's picture, and a score for each class.
What follows the classes (a pose's keypoints) is left alone.
"""

from __future__ import annotations

import numpy as np

from ..description import Description
from ..graph import UNIT, Graph, sound
from .boxes import Boxes, corners_of

TYPE = "yolov8"
NORMALIZATION = UNIT
CENTERED, STRETCHED = True, False


def recognises(graph: Graph) -> bool:
    """One output, and fewer numbers in a column than there are columns: a box for every cell of the grids."""
    if len(graph.shapes) != 1 or len(graph.shapes[0]) != 3:
        return False
    _, numbers, boxes = graph.shapes[0]
    return numbers >= 5 and boxes == sum((graph.width // s) * (graph.height // s) for s in (8, 16, 32))


def decode(outputs: list[np.ndarray], graph: Graph, said: Description) -> Boxes:
    """The boxes of people in pixels of the network's picture."""
    columns = sound(outputs[0])[0]
    return Boxes(corners_of(columns[:4].T), columns[4 + said.person_class])
