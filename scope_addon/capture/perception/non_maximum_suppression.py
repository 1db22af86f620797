# SPDX-License-Identifier: GPL-3.0-or-later
"""Which boxes of a detector show the same thing: what every non-maximum suppression starts with."""

from __future__ import annotations

import numpy as np


def overlap_clusters(corners: np.ndarray, threshold: float) -> list[np.ndarray]:
    """Indices of boxes (N, 4 left, top, right, bottom; best first), cluster by cluster, each with its best one first.

    A cluster is the best remaining box and all whose intersection over union with it exceeds the threshold.
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
