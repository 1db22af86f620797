# SPDX-License-Identifier: GPL-3.0-or-later
"""Clusters of overlapping boxes, the first step of non-maximum suppression."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def overlap_clusters(corners: NDArray[np.float64], threshold: float) -> list[NDArray[np.intp]]:
    """Cluster boxes: the best remaining box and all whose intersection over union with it exceeds the threshold.

    :param corners: (N, 4 + M) left, top, right, bottom and M more columns; best box first.
    :return: indices of the boxes of each cluster, the best first.
    """
    low, high = corners[:, :2], corners[:, 2:4]
    area = np.maximum(high - low, 0).prod(axis=1)
    remaining = np.arange(len(corners))
    clusters = []
    while len(remaining):
        best = remaining[0]
        sides = np.minimum(high[best], high[remaining]) - np.maximum(low[best], low[remaining])
        shared = np.maximum(sides, 0).prod(axis=1)
        same = shared > threshold * (area[best] + area[remaining] - shared)
        same[0] = True
        clusters.append(remaining[same])
        remaining = remaining[~same]
    return clusters
