# SPDX-License-Identifier: GPL-3.0-or-later
"""YOLOv4 and similar: ``boxes`` (1, N, 1, 4) and ``confs`` (1, N, classes), in either order.

A box is left, top, right, bottom as fractions of the input, to which the image was stretched regardless of its aspect
ratio; a score is that of the class.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..description import Description
from ..graph import UNIT, Graph, finite
from .boxes import Boxes

TYPE = "yolov4"
NORMALIZATION = UNIT
CENTERED, STRETCHED = False, True


def matches(graph: Graph) -> bool:
    """Check for two outputs with a row per box, one of them with four numbers per row."""
    if len(graph.shapes) != 2:
        return False
    first = _boxes_first(graph.shapes)
    boxes, scores = graph.shapes if first else graph.shapes[::-1]
    return _is_boxes(boxes) and len(scores) == 3 and scores[1] == boxes[1]


def decode(outputs: list[NDArray[Any]], graph: Graph, description: Description) -> Boxes:
    """Read the boxes of people, in pixels of the network's input.

    :param outputs: ``boxes`` (1, N, 1, 4) and ``confs`` (1, N, C) for C classes, in either order; see the module.
    """
    boxes, scores = outputs if _boxes_first([o.shape for o in outputs]) else outputs[::-1]
    size = np.array([graph.width, graph.height] * 2, float)
    return Boxes(finite(boxes).reshape(-1, 4) * size, finite(scores)[0, :, description.person_class])


def _boxes_first(shapes: list[tuple[int, ...]]) -> bool:
    return not _is_boxes(shapes[1]) or _is_boxes(shapes[0])


def _is_boxes(shape: tuple[int, ...]) -> bool:
    return len(shape) == 4 and shape[2:] == (1, 4)
