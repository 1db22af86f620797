# SPDX-License-Identifier: GPL-3.0-or-later
"""What all box detectors share: the letterboxed picture they look at, suppression of doubles, and the way back.

Positions in the network's picture are measured from its left and top edges, as detectors do; positions in the image
from the centre of the top left pixel, as OpenCV does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...letterbox import Letterbox, fit_in
from ...non_maximum_suppression import overlap_clusters

_BORDER = 114  # the grey that the YOLO family is trained with
OVERLAP_THRESHOLD = 0.5


@dataclass(frozen=True)
class Boxes:
    """``corners`` (N, 4) left, top, right, bottom in pixels of the network's picture; ``scores`` (N,) 0..1."""

    corners: np.ndarray
    scores: np.ndarray


def letterbox(image_rgb: np.ndarray, width: int, height: int, *, centered: bool, stretched: bool = False) -> Letterbox:
    """The image as the YOLO family wants it, on its grey."""
    return fit_in(image_rgb, width, height, border=_BORDER, centered=centered, stretched=stretched)


def corners_of(centers_and_sizes: np.ndarray) -> np.ndarray:
    """(N, 4) centre x, y, width, height -> left, top, right, bottom."""
    center, half = centers_and_sizes[:, :2], centers_and_sizes[:, 2:4] / 2
    return np.concatenate([center - half, center + half], axis=1)


def suppress(boxes: Boxes, threshold: float) -> Boxes:
    """The boxes of at least this score, best first, without those that overlap a better one by more than half."""
    size = boxes.corners[:, 2:] - boxes.corners[:, :2]
    chosen = np.flatnonzero((boxes.scores >= threshold) & (size > 0).all(axis=1))
    order = chosen[np.argsort(-boxes.scores[chosen], kind="stable")]
    kept = order[[cluster[0] for cluster in overlap_clusters(boxes.corners[order], OVERLAP_THRESHOLD)]]
    return Boxes(boxes.corners[kept], boxes.scores[kept])
