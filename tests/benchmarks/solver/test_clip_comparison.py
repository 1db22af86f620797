# SPDX-License-Identifier: GPL-3.0-or-later
"""The dense way that a clip is compared with leads to the step of the elimination over time."""

import numpy as np
from scope.benchmarks.solver.clip_comparison import dense_equations
from scope.benchmarks.solver.clip_steps import make_clip
from scope.benchmarks.solver.dense import solve_cholesky
from scope.solver.motion.band import make_factor, solve_clip


def test_dense_matrix_and_elimination_give_the_same_step():
    problem, poses = make_clip(23, 5, contacts=0)
    system = problem.make_system()
    scale = problem.settings.root_scale
    problem.linearize(0, poses, system)
    factor = make_factor(system)
    parts = len(problem.tree.parents)
    count = problem.tree.globals
    solve_clip(problem.tree, system, 1.0, scale, factor)
    d = solve_cholesky(*dense_equations(system, 5, parts, count, 1.0, scale))
    steps = d[:-count].reshape(5, -1)
    shared = d[-count:]
    np.testing.assert_allclose(
        steps, factor.d[:, : steps.shape[1]], rtol=0, atol=1e-8 * np.abs(d).max()
    )
    np.testing.assert_allclose(shared, factor.dg[:count], rtol=0, atol=1e-8 * np.abs(d).max())
