# SPDX-License-Identifier: GPL-3.0-or-later
"""The path with the least cost, against all possible paths."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from scope.scope_addon.kinematics.viterbi import least_cost_path


@pytest.mark.parametrize("barred", [0.0, 0.4])
@pytest.mark.parametrize(("count", "states"), [(1, 3), (2, 2), (5, 3), (6, 4)])
def test_no_other_path_costs_less(count: int, states: int, barred: float) -> None:
    rng = np.random.default_rng(count)
    for _ in range(5):
        costs = rng.normal(size=(count, states))
        switching = rng.normal(size=(count - 1, states, states))
        switching[rng.random(switching.shape) < barred] = np.inf
        switching[:, 0, 0] = 1.0  # there is always a way

        def cost(path, costs=costs, switching=switching) -> float:
            there = sum(costs[t, x] for t, x in enumerate(path))
            return there + sum(switching[t, a, b] for t, (a, b) in enumerate(pairwise(path)))

        expected = min(product(range(states), repeat=count), key=cost)
        assert tuple(least_cost_path(costs, switching)) == expected


def test_ties_are_resolved_to_lower_states() -> None:
    assert least_cost_path(np.zeros((4, 3)), np.zeros((3, 3, 3))).tolist() == [0, 0, 0, 0]


def test_no_frames() -> None:
    assert least_cost_path(np.zeros((0, 3)), np.zeros((0, 3, 3))).shape == (0,)
