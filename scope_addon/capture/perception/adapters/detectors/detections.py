# SPDX-License-Identifier: GPL-3.0-or-later
"""MMDeploy's detectors: ``dets`` (1, N, 5) and ``labels`` (1, N), with non-maximum suppression inside the graph.

A row is left, top, right, bottom in pixels of the network's input, and the score. Several families of networks are
exported with these outputs, each with its own normalization, which their JSON has to specify.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from ..description import Description
from ..graph import PIXELS_BGR, Graph, finite
from .boxes import Boxes

TYPE = "detections"
NORMALIZATION = PIXELS_BGR
CENTERED, STRETCHED = False, False


def matches(graph: Graph) -> bool:
    """Check for rows of five, and one label per row."""
    if len(graph.shapes) != 2:
        return False
    rows, labels = graph.shapes
    return len(rows) == 3 and rows[2] == 5 and labels == rows[:2]


def decode(outputs: list[NDArray[Any]], graph: Graph, description: Description) -> Boxes:
    """Read the boxes of people, in pixels of the network's input.

    :param outputs: ``dets`` (1, N, 5) and ``labels`` (1, N); see the module.
    """
    people = outputs[1][0] == description.person_class
    rows = finite(outputs[0])[0][people]
    return Boxes(rows[:, :4], rows[:, 4])
