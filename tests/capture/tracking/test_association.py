# SPDX-License-Identifier: GPL-3.0-or-later
"""Assignment against all permutations, and links of tracklets whose people are known."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from scope.scope_addon.capture.tracking.appearance import SIZE
from scope.scope_addon.capture.tracking.people import assign, link
from scope.scope_addon.capture.tracking.track import Tracklet

RATE = 30.0
RED = np.eye(SIZE)[0] + np.eye(SIZE)[SIZE // 2]
BLUE = np.eye(SIZE)[3] + np.eye(SIZE)[SIZE // 2 + 3]


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (4, 6)])
@pytest.mark.parametrize("seed", range(5))
def test_the_assignment_is_the_cheapest_of_all(shape: tuple[int, int], seed: int) -> None:
    cost = np.random.default_rng(seed).normal(size=shape)
    chosen = assign(cost)
    assert len(set(chosen)) == shape[0]
    rows = range(shape[0])
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
    side_px: float = 200.0,
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
        sides_px=[side_px] * len(rows),
        appearance=appearance,
    )


def test_a_crossing_is_resolved_by_motion() -> None:
    """Two people in the same clothes pass each other between frames 50 and 60, where neither is
    seen.
    """
    times = (np.arange(120) / RATE).tolist()
    right = (0.0, 8.0)
    left = (880.0, -8.0)
    tracklets = [
        tracklet(*rows, *motion, RED) for rows in ((0, 50), (60, 120)) for motion in (right, left)
    ]
    assert sorted(link(tracklets, times)) == [[0, 2], [1, 3]]


@pytest.mark.parametrize(("others", "people"), [(RED, [[0, 3], [1, 2]]), (BLUE, [[0, 2], [1, 3]])])
def test_clothes_tell_people_who_turn_back_from_people_who_pass_each_other(
    others: np.ndarray, people: list[list[int]]
) -> None:
    """They come towards each other and leave again; nobody is seen between frames 50 and 60."""
    times = (np.arange(120) / RATE).tolist()
    right = (0.0, 8.0)
    left = (880.0, -8.0)
    before = [tracklet(0, 50, *right, RED), tracklet(0, 50, *left, others)]
    after = [tracklet(60, 120, *left, RED), tracklet(60, 120, *right, others)]
    assert sorted(link(before + after, times)) == people


def test_tracklets_at_the_same_time_are_different_people() -> None:
    times = (np.arange(60) / RATE).tolist()
    tracklets = [tracklet(0, 60, 100.0, 0.0, RED), tracklet(20, 60, 100.0, 0.0, RED), Tracklet()]
    assert sorted(link(tracklets, times)) == [[0], [1]]
