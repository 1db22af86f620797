# SPDX-License-Identifier: GPL-3.0-or-later
"""YOLOv4-type: ``boxes`` (1, N, 1, 4) and ``confs`` (1, N, classes).

A box is left, top, right, bottom as shares of the picture, into which the image was stretched without regard to its
proportions; a score is that of the class.
"""

from __future__ import annotations

import numpy as np

from .boxes import Boxes
from .description import Description
from .graph import UNIT, Graph, sound

TYPE = "yolov4"
NORMALIZATION = UNIT
CENTERED, STRETCHED = False, True


def recognises(graph: Graph) -> bool:
    """Two outputs with a row per box, one of them four numbers wide."""
    if len(graph.shapes) != 2:
        return False
    boxes, scores = graph.shapes[0], graph.shapes[1]
    is_boxes = len(boxes) == 4 and boxes[2:] == (1, 4)
    return is_boxes and len(scores) == 3 and scores[1] == boxes[1]


def decode(outputs: list[np.ndarray], graph: Graph, said: Description) -> Boxes:
    """The boxes of people in pixels of the network's picture."""
    size = np.array([graph.width, graph.height] * 2, float)
    return Boxes(sound(outputs[0]).reshape(-1, 4) * size, sound(outputs[1])[0, :, said.person_class])
