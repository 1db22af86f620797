# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts that all box detectors share: letterboxing and non-maximum suppression.

Positions in the network's input are measured from its left and top edges, as detectors do; positions in the image
from the centre of the top left pixel, as OpenCV does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...non_maximum_suppression import overlap_clusters

BORDER = 114  # the grey level that the YOLO family is trained with
OVERLAP_THRESHOLD = 0.5
MAX_BOXES = 5000  # the best ones are compared with each other; a broken network may output millions


@dataclass(frozen=True)
class Boxes:
    """Boxes: ``corners`` (N, 4) left, top, right, bottom in pixels of the network's input; ``scores`` (N,) 0..1."""

    corners: NDArray[np.float64]
    scores: NDArray[np.float64]


def corners_of(centers_and_sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert (N, 4) centre x, y, width, height to left, top, right, bottom."""
    center, half = centers_and_sizes[:, :2], centers_and_sizes[:, 2:4] / 2
    return np.concatenate([center - half, center + half], axis=1)


def suppress(boxes: Boxes, threshold: float) -> Boxes:
    """Apply non-maximum suppression.

    :param threshold: least score.
    :return: the remaining boxes, best first; none overlaps a better one by more than half.
    """
    size = boxes.corners[:, 2:] - boxes.corners[:, :2]
    chosen = np.flatnonzero((boxes.scores >= threshold) & (size > 0).all(axis=1))
    order = chosen[np.argsort(-boxes.scores[chosen], kind="stable")][:MAX_BOXES]
    kept = order[[cluster[0] for cluster in overlap_clusters(boxes.corners[order], OVERLAP_THRESHOLD)]]
    return Boxes(boxes.corners[kept], boxes.scores[kept])
