# SPDX-License-Identifier: GPL-3.0-or-later
"""Each set's keypoints arrive at those of their names."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.adapters.keypoint_sets import COCO_17, KEYPOINT_SETS
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES


def numbered(count: int) -> tuple[np.ndarray, np.ndarray]:
    return np.stack([np.arange(count), 1000 - np.arange(count)], axis=1).astype(float), np.linspace(
        0.5, 1, count
    )


@pytest.mark.parametrize("name", KEYPOINT_SETS)
def test_keypoint_orders(name: str) -> None:
    points, scores = numbered(KEYPOINT_SETS[name].count)
    ours, confidence = KEYPOINT_SETS[name].to_blazepose(points, scores)
    at = dict(zip(KEYPOINT_NAMES, ours[:, 0], strict=True))
    known = dict(zip(KEYPOINT_NAMES, confidence, strict=True))
    assert at["nose"] == 0
    assert (at["left_shoulder"], at["right_shoulder"], at["right_ankle"]) == (5, 6, 16)
    assert known["right_ankle"] == scores[16]
    if name == "coco17":
        assert {n for n, c in known.items() if c > 0} == set(COCO_17)
    if name == "halpe26":
        assert (at["left_heel"], at["right_heel"]) == (24, 25)
        assert at["right_foot_index"] == pytest.approx(0.85 * 21 + 0.15 * 23)
        assert known["left_thumb"] == 0
    if name == "wholebody133":
        assert (at["left_heel"], at["right_heel"]) == (19, 22)
        assert at["left_foot_index"] == pytest.approx(0.85 * 17 + 0.15 * 18)
        assert (at["right_eye_outer"], at["left_eye_outer"], at["mouth_left"]) == (59, 68, 77)
        assert (at["left_index"], at["right_pinky"], at["right_thumb"]) == (96, 129, 115)
        assert min(known.values()) > 0
