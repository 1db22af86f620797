# SPDX-License-Identifier: GPL-3.0-or-later
"""The dense optimizer on problems whose minima are known."""

import numpy as np
import pytest
from scope.benchmarks.smplify.dense import minimize


def test_a_linear_problem_has_the_normal_equations_solution():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(20, 6))
    b = rng.normal(size=20)
    found = minimize(lambda x: x @ A.T - b, np.zeros(6), np.ones(6, bool), 50, 1e-15)
    np.testing.assert_allclose(found.x, np.linalg.lstsq(A, b, rcond=None)[0], atol=1e-6)
    assert found.cost == pytest.approx(0.5 * np.sum((A @ found.x - b) ** 2))
