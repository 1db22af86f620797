# SPDX-License-Identifier: GPL-3.0-or-later
"""Clusters of overlapping boxes."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.capture.perception.person_detector import overlap_clusters


def iou(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union by counting unit squares of boxes with whole corners."""
    inside = [
        {(x, y) for x in range(int(p[0]), int(p[2])) for y in range(int(p[1]), int(p[3]))}
        for p in (a, b)
    ]
    return len(inside[0] & inside[1]) / len(inside[0] | inside[1])


def test_each_box_is_in_the_cluster_of_the_best_box_that_it_overlaps():
    rng = np.random.default_rng(3)
    low = rng.integers(0, 12, (40, 2))
    boxes = np.concatenate([low, low + rng.integers(1, 9, (40, 2))], axis=1).astype(float)
    clusters = [cluster.tolist() for cluster in overlap_clusters(boxes, 0.3)]
    expected = []
    for k in range(len(boxes)):
        for cluster in expected:
            if iou(boxes[cluster[0]], boxes[k]) > 0.3:
                cluster.append(k)
                break
        else:
            expected.append([k])
    assert clusters == expected
    assert 1 < len(clusters) < len(boxes)


def test_boxes_without_area_and_further_columns():
    boxes = np.array([[3.0, 3, 3, 3, 7], [0, 0, 2, 2, 8], [3, 3, 3, 3, 9]])
    assert [cluster.tolist() for cluster in overlap_clusters(boxes, 0.5)] == [[0], [1], [2]]
    assert overlap_clusters(np.zeros((0, 4)), 0.5) == []
