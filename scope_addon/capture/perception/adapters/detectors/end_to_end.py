# SPDX-License-Identifier: GPL-3.0-or-later
"""Detectors with non-maximum suppression inside the graph (YOLOv10, YOLO26, ``nms=True``): one output (1, N, 6).

N is mostly 300. A row is left, top, right, bottom in pixels of the network's input, score and index of the class.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..description import Description
from ..graph import UNIT, Graph, finite
from .boxes import Boxes

TYPE = "end_to_end"
NORMALIZATION = UNIT
CENTERED, STRETCHED = True, False


def matches(graph: Graph) -> bool:
    """Check for rows of six. YOLOX with one class, which has them for every cell, is matched before."""
    return len(graph.shapes) == 1 and len(graph.shapes[0]) == 3 and graph.shapes[0][2] == 6


def decode(outputs: list[NDArray[Any]], graph: Graph, description: Description) -> Boxes:
    """Read the boxes of people, in pixels of the network's input.

    :param outputs: one, (1, N, 6); see the module.
    """
    rows = finite(outputs[0])[0]
    rows = rows[np.round(rows[:, 5]) == description.person_class]
    return Boxes(rows[:, :4], rows[:, 4])
