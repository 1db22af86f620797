# SPDX-License-Identifier: GPL-3.0-or-later
"""Detectors with suppression inside the graph: one output (1, N, 6), mostly N = 300 (YOLOv10, YOLO26, ``nms=True``).

A row is left, top, right, bottom in pixels of the network's picture, score and number of the class.
"""

from __future__ import annotations

import numpy as np

from ..description import Description
from ..graph import UNIT, Graph, sound
from .boxes import Boxes

TYPE = "end_to_end"
NORMALIZATION = UNIT
CENTERED, STRETCHED = True, False


def recognises(graph: Graph) -> bool:
    """Rows of six, not as many as there are cells: that would be YOLOX with one class."""
    return len(graph.shapes) == 1 and len(graph.shapes[0]) == 3 and graph.shapes[0][2] == 6


def decode(outputs: list[np.ndarray], graph: Graph, said: Description) -> Boxes:
    """The boxes of people in pixels of the network's picture."""
    rows = sound(outputs[0])[0]
    rows = rows[np.round(rows[:, 5]) == said.person_class]
    return Boxes(rows[:, :4], rows[:, 4])
