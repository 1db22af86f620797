# SPDX-License-Identifier: GPL-3.0-or-later
"""Sequences of states of a clip's frames: the runs in which something holds, and the path of least
cost, where a step's cost depends on the state before (Viterbi).
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, Float64Array, IndexArray


def runs(mask: BoolArray) -> list[tuple[int, int]]:
    """Return the first row and the row after the last one of each run of True in ``mask``, (T,)."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False]))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def least_cost_path(costs: Float64Array, switching: Float64Array) -> IndexArray:
    """Find the states x that minimize Σ_t costs[t, x_t] + Σ_{t≥1} switching[t−1, x_{t−1}, x_t].

    Ties are resolved in favour of lower state numbers.

    :param costs: (T, S) cost of each state.
    :param switching: (T−1, S, S) cost of going from one state (row) to another (column); inf:
        impossible.
    :return: (T,) states.
    """
    T, S = costs.shape
    path = np.zeros(T, int)
    came_from = np.zeros((T, S), np.int8)
    if T == 0:
        return path
    total = costs[0]
    for t in range(1, T):
        totals = total[:, None] + switching[t - 1]
        came_from[t] = totals.argmin(axis=0)
        total = totals.min(axis=0) + costs[t]
    path[-1] = total.argmin()
    for t in range(T - 1, 0, -1):
        path[t - 1] = came_from[t, path[t]]
    return path
