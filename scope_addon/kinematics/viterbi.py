# SPDX-License-Identifier: GPL-3.0-or-later
"""The sequence of states that costs the least, where each step's cost depends on the state before (Viterbi)."""

from __future__ import annotations

import numpy as np


def least_cost_path(costs: np.ndarray, switching: np.ndarray) -> np.ndarray:
    """The states x that minimise Σ_t costs[t, x_t] + Σ_{t≥1} switching[t−1, x_{t−1}, x_t]; of equals, lower numbers.

    :param costs: (T, S) of being in a state.
    :param switching: (T−1, S, S) of going from one state (row) to another (column); inf where there is no way.
    :return: (T,) int.
    """
    T, S = costs.shape
    path, came_from = np.zeros(T, int), np.zeros((T, S), np.int8)
    if T == 0:
        return path
    total = costs[0]
    for t in range(1, T):
        ways = total[:, None] + switching[t - 1]
        came_from[t] = ways.argmin(axis=0)
        total = ways.min(axis=0) + costs[t]
    path[-1] = total.argmin()
    for t in range(T - 1, 0, -1):
        path[t - 1] = came_from[t, path[t]]
    return path
