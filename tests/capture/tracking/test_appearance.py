# SPDX-License-Identifier: GPL-3.0-or-later
"""Appearances of synthetic people in coloured clothes."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.tracking.appearance import SIZE, appearance, distance

RED = (200, 30, 30)
BLUE = (30, 30, 200)
GREY = (120, 120, 120)
BODY = np.full((33, 2), 200.0)
for _side, _x in (("left", 230.0), ("right", 170.0)):
    for _name, _y in (("shoulder", 80.0), ("hip", 190.0), ("knee", 270.0), ("ankle", 350.0)):
        BODY[KEYPOINT_NAMES.index(f"{_side}_{_name}")] = _x, _y


def picture(
    shirt: tuple[int, int, int], trousers: tuple[int, int, int], light: float = 1.0
) -> np.ndarray:
    image = np.full((400, 400, 3), 255, np.uint8)
    image[60:190, 140:260] = np.array(shirt) * light
    image[190:400, 140:260] = np.array(trousers) * light
    return image


def test_each_histogram_is_normalized() -> None:
    found = appearance(picture(RED, GREY), BODY)
    assert found.shape == (SIZE,)
    np.testing.assert_allclose(np.square(found).reshape(2, -1).sum(axis=1), 1.0)


@pytest.mark.slow
def test_distances_order_people_by_their_clothes() -> None:
    first = appearance(picture(RED, GREY), BODY)
    darker = appearance(picture(RED, GREY, light=0.9), BODY)
    half = appearance(picture(RED, BLUE), BODY)
    other = appearance(picture(BLUE, RED), BODY)
    assert distance(first, first) == pytest.approx(0.0, abs=1e-6)
    assert distance(first, 5 * first) == pytest.approx(0.0, abs=1e-6)  # sums over frames
    assert distance(first, darker) < 0.35 < distance(first, half) < distance(first, other)
    assert distance(first, other) > 0.8
