# SPDX-License-Identifier: GPL-3.0-or-later
"""Assignment against all permutations, and links of tracklets whose people are known."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from scope.scope_addon.capture.tracking.appearance import SIZE
from scope.scope_addon.capture.tracking.people import assign, link
from scope.scope_addon.capture.tracking.track import Tracklet

from .made_tracklets import seen_at

TIMES = (np.arange(120) / 30).tolist()
RED = np.eye(SIZE)[0] + np.eye(SIZE)[SIZE // 2]
BLUE = np.eye(SIZE)[3] + np.eye(SIZE)[SIZE // 2 + 3]


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (4, 6)])
def test_the_assignment_is_the_cheapest_of_all(shape: tuple[int, int]) -> None:
    rows = range(shape[0])
    for cost in np.random.default_rng(0).normal(size=(5, *shape)):
        chosen = assign(cost)
        assert len(set(chosen)) == shape[0]
        best = min(
            cost[rows, list(columns)].sum() for columns in permutations(range(shape[1]), shape[0])
        )
        assert cost[rows, chosen].sum() == pytest.approx(best)


RIGHT = 8.0 * np.arange(120)  # where somebody is who walks so
LEFT = 880.0 - RIGHT


@pytest.mark.parametrize(("others", "people"), [(RED, [[0, 3], [1, 2]]), (BLUE, [[0, 2], [1, 3]])])
def test_motion_and_clothes_tell_people_who_turn_back_from_people_who_pass_each_other(
    others: np.ndarray, people: list[list[int]]
) -> None:
    """They come towards each other and leave again; nobody is seen between frames 50 and 60."""
    before = [seen_at(RIGHT[:50], appearance=RED), seen_at(LEFT[:50], appearance=others)]
    after = [seen_at(LEFT[60:], 60, appearance=RED), seen_at(RIGHT[60:], 60, appearance=others)]
    assert sorted(link(before + after, TIMES)) == people


def test_tracklets_at_the_same_time_are_different_people() -> None:
    tracklets = [seen_at([100.0] * 60), seen_at([100.0] * 40, 20), Tracklet()]
    assert sorted(link(tracklets, TIMES)) == [[0], [1]]
