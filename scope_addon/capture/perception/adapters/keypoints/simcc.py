# SPDX-License-Identifier: GPL-3.0-or-later
"""SimCC (RTMPose, RTMW): two rows of scores per keypoint, along x and along y, in bins of a fraction of a pixel.

``simcc_x`` (1, J, ratio · width), ``simcc_y`` (1, J, ratio · height); pixel = argmax / ratio, the score is the
smaller of the two maxima. The ratio, mostly 2, follows from the sizes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..graph import IMAGENET, Graph, finite

TYPE = "simcc"
NORMALIZATION = IMAGENET


def matches(graph: Graph) -> bool:
    """Check for two rows per keypoint, along the width and the height of the input."""
    return _axes(graph) is not None


def decode(outputs: list[NDArray[Any]], graph: Graph) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Locate the keypoints.

    :param outputs: see the module.
    :return: (J, 2) pixels of the network's input, the top left pixel's centre at 0, and (J,) scores.
    """
    axes = _axes(graph)
    assert axes is not None
    along_x, along_y = (finite(outputs[k])[0] for k in axes)
    ratio = along_x.shape[1] / graph.width
    points = np.stack([along_x.argmax(axis=1), along_y.argmax(axis=1)], axis=1) / ratio
    return points, np.minimum(along_x.max(axis=1), along_y.max(axis=1))


def _axes(graph: Graph) -> tuple[int, int] | None:
    """Find the indices of the outputs along x and along y; None if there are none."""
    shapes = graph.shapes
    if len(shapes) != 2 or any(len(s) != 3 for s in shapes) or shapes[0][:2] != shapes[1][:2]:
        return None
    orders = [(0, 1), (1, 0)]
    if graph.names[0].lower().endswith("y"):
        orders.reverse()
    for x, y in orders:
        ratio = shapes[x][2] / graph.width
        if ratio >= 1 and abs(shapes[y][2] - ratio * graph.height) < 1:
            return x, y
    return None
