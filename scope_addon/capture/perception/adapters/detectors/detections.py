# SPDX-License-Identifier: GPL-3.0-or-later
"""MMDeploy's detectors: ``dets`` (1, N, 5) and ``labels`` (1, N), suppression inside the graph.

A row is left, top, right, bottom in pixels of the network's picture, and the score. Networks of several families are
exported like this, each with its own normalisation, so that their JSON has to say it.
"""

from __future__ import annotations

import numpy as np

from ..description import Description
from ..graph import PIXELS_BGR, Graph, sound
from .boxes import Boxes

TYPE = "detections"
NORMALIZATION = PIXELS_BGR
CENTERED, STRETCHED = False, False


def recognises(graph: Graph) -> bool:
    """Rows of five and a number for each."""
    if len(graph.shapes) != 2:
        return False
    rows, labels = graph.shapes
    return len(rows) == 3 and rows[2] == 5 and labels == rows[:2]


def decode(outputs: list[np.ndarray], graph: Graph, said: Description) -> Boxes:
    """The boxes of people in pixels of the network's picture."""
    people = outputs[1][0] == said.person_class
    rows = sound(outputs[0])[0][people]
    return Boxes(rows[:, :4], rows[:, 4])
