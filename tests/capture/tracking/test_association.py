# SPDX-License-Identifier: GPL-3.0-or-later
"""Assignment against all permutations, and links of tracklets whose people are known."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from scope.scope_addon.capture.tracking.appearance import SIZE
from scope.scope_addon.capture.tracking.people import assign, link
from scope.scope_addon.capture.tracking.track import Tracklet

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


def tracklet(
    first: int,
    last: int,
    start_px: float,
    speed_px: float,
    appearance: np.ndarray,
) -> Tracklet:
    """A person who moves horizontally at ``speed_px`` per frame, and would be at ``start_px`` in
    frame 0.
    """
    rows = list(range(first, last))
    centers = [np.array([start_px + speed_px * row, 200.0]) for row in rows]
    values = [np.zeros((33, 6), np.float32)] * len(rows)
    return Tracklet(
        rows=rows,
        values=values,
        centers_px=centers,
        sides_px=[200.0] * len(rows),
        appearance=appearance,
    )


RIGHT = (0.0, 8.0)  # place and speed of somebody who walks so
LEFT = (880.0, -8.0)


def test_a_crossing_is_resolved_by_motion() -> None:
    """Two people in the same clothes pass each other between frames 50 and 60, where neither is
    seen.
    """
    tracklets = [
        tracklet(*rows, *motion, RED) for rows in ((0, 50), (60, 120)) for motion in (RIGHT, LEFT)
    ]
    assert sorted(link(tracklets, TIMES)) == [[0, 2], [1, 3]]


@pytest.mark.parametrize(("others", "people"), [(RED, [[0, 3], [1, 2]]), (BLUE, [[0, 2], [1, 3]])])
def test_clothes_tell_people_who_turn_back_from_people_who_pass_each_other(
    others: np.ndarray, people: list[list[int]]
) -> None:
    """They come towards each other and leave again; nobody is seen between frames 50 and 60."""
    before = [tracklet(0, 50, *RIGHT, RED), tracklet(0, 50, *LEFT, others)]
    after = [tracklet(60, 120, *LEFT, RED), tracklet(60, 120, *RIGHT, others)]
    assert sorted(link(before + after, TIMES)) == people


def test_tracklets_at_the_same_time_are_different_people() -> None:
    tracklets = [tracklet(0, 60, 100.0, 0.0, RED), tracklet(20, 60, 100.0, 0.0, RED), Tracklet()]
    assert sorted(link(tracklets, TIMES)) == [[0], [1]]
