# SPDX-License-Identifier: GPL-3.0-or-later
"""The dense way that a clip is compared with leads to the step of the elimination over time.

Conjugate gradients on a clip lead to the step of the elimination over time.

The dense baseline and the sparse solver give the same direction.
"""

import numpy as np
import pytest
from scope.benchmarks.solver.clip_comparison import dense_equations
from scope.benchmarks.solver.clip_gradients import ConjugateGradients
from scope.benchmarks.solver.clip_steps import make_clip
from scope.benchmarks.solver.dense import Dense, solve_cholesky
from scope.benchmarks.solver.loops import put
from scope.benchmarks.solver.problem import make_problem
from scope.solver.gauss_newton.linearize import linearize, make_blocks, make_pose
from scope.solver.gauss_newton.recursion import make_workspace, step
from scope.solver.motion.band import make_factor, solve_clip


def test_dense_matrix_and_elimination_give_the_same_step():
    problem, poses = make_clip(23, 5, contacts=0)
    system = problem.make_system()
    scale = problem.settings.root_scale
    problem.linearize(0, poses, system)
    factor = make_factor(system)
    parts = len(problem.tree.parents)
    count = problem.tree.global_count
    solve_clip(problem.tree, system, 1.0, scale, factor)
    d = solve_cholesky(*dense_equations(system, 5, parts, count, 1.0, scale))
    steps = d[:-count].reshape(5, -1)
    shared = d[-count:]
    np.testing.assert_allclose(
        steps, factor.d[:, : steps.shape[1]], rtol=0, atol=1e-8 * np.abs(d).max()
    )
    np.testing.assert_allclose(shared, factor.dg[:count], rtol=0, atol=1e-8 * np.abs(d).max())


@pytest.mark.slow
def test_gradients_and_elimination_agree():
    problem, poses = make_clip(23, 6, gap=1, fixed=True, contacts=0)
    system = problem.make_system()
    problem.linearize(0, poses, system)
    factor = make_factor(system)
    used = 75
    solve_clip(problem.tree, system, 1.0, problem.settings.root_scale, factor)
    gradients = ConjugateGradients(problem, poses, 1.0, problem.settings.root_scale)
    d, iterations = gradients.solve(np.ascontiguousarray(system.N[:, :used, 0]), 1e-11)
    assert iterations < 400
    np.testing.assert_allclose(d, factor.d[:, :used], rtol=0, atol=1e-8 * np.abs(d).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("K", "P", "N", "prior"),
    [
        (23, 10, 52, True),
        (51, 10, 120, False),
        (23, 0, 120, False),
    ],
)
def test_dense_and_sparse_steps_agree(K, P, N, prior):
    p = make_problem(K, P, N, prior)
    pose = make_pose(p.tree)
    blocks = make_blocks(p.tree)
    work = make_workspace(p.tree)
    dense = Dense(p)
    for k in (0, 5):
        put(p.bank, k, pose)
        linearize(p.tree, p.terms, p.stage, pose, blocks, work.scratch)
        step(p.tree, pose, blocks, p.damping, p.root_scale, work)
        found = np.concatenate([work.x[0], work.u[1:].ravel(), work.dbeta[:P]])
        expected = dense.step(k)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
