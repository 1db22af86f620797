# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas that are compiled to vector instructions, against the same in numpy."""

import numpy as np
from scope.solver.compiled import simd
from scope.solver.compiled.kernel import kernel


def _formula(q, state):
    """All operators, with numbers on either side."""
    a = q(0)
    b = q(1)
    x, y = state
    return 2.0 - a * x, (x + b) / (1.0 + y * y), simd.sqrt(1.0 + a * a) - 3.0 / (2.0 + b * b)


apply = simd.vectorized(_formula, reads=2)


@kernel
def _run(table, at, state) -> None:
    apply(table, at, state)


def test_a_formula_gives_what_numpy_gives() -> None:
    rng = np.random.default_rng(2)
    width = simd.WIDTH
    at = 5
    table = rng.normal(size=at + 2 * width + 3)
    state = rng.normal(size=3 * width)
    before = state.copy()
    given = [table[at + k * width : at + (k + 1) * width] for k in range(2)]
    expected = np.concatenate(
        _formula(given.__getitem__, [before[:width], before[width : 2 * width]])
    )
    _run(table, at, state)
    np.testing.assert_allclose(state, expected, rtol=1e-14)
