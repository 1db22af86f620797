# SPDX-License-Identifier: GPL-3.0-or-later
"""Levenberg-Marquardt with a dense Jacobian by differences: the cost of an optimizer that ignores
all structure.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

STEP = 1e-6  # of the forward differences
# relative to the diagonal of JᵀJ
DAMPING = 1e-3
MIN_DAMPING = 1e-9
MAX_DAMPING = 1e9
Vector = NDArray[np.float64]
Residuals = Callable[[Vector], Vector]  # (B, n) -> (B, m): B points at a time


class Minimum(NamedTuple):
    """Where the optimizer ended."""

    x: Vector  # (n,)
    cost: float  # half the sum of squares
    iterations: int


def minimize(
    residuals: Residuals, x: Vector, free: NDArray[np.bool_], limit: int, tolerance: float
) -> Minimum:
    """Minimize half the sum of squared residuals over the free unknowns.

    (JᵀJ + λ diag JᵀJ) d = −Jᵀr (Marquardt 1963), λ divided by 10 after a decrease and multiplied by
    10 otherwise.

    :param residuals: from points (B, n) to residuals (B, m).
    :param x: (n,) start.
    :param free: (n,) the unknowns that may change.
    :param tolerance: ends at a smaller relative decrease.
    """
    damping = DAMPING
    at = np.flatnonzero(free)
    r = residuals(x[None])[0]
    cost = 0.5 * float(r @ r)
    for iteration in range(limit):
        moved = np.repeat(x[None], len(at), axis=0)
        moved[np.arange(len(at)), at] += STEP
        J = (residuals(moved) - r).T / STEP
        JTJ = J.T @ J
        gradient = J.T @ r
        while True:
            d = np.linalg.solve(JTJ + np.diag(damping * np.diag(JTJ) + 1e-12), -gradient)
            trial = x.copy()
            trial[at] += d
            r_trial = residuals(trial[None])[0]
            lower = 0.5 * float(r_trial @ r_trial)
            if lower < cost:
                break
            damping *= 10
            if damping > MAX_DAMPING:
                return Minimum(x, cost, iteration)
        decrease = (cost - lower) / cost
        x = trial
        r = r_trial
        cost = lower
        damping = max(damping / 10, MIN_DAMPING)
        if decrease < tolerance:
            return Minimum(x, cost, iteration + 1)
    return Minimum(x, cost, limit)
