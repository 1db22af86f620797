# SPDX-License-Identifier: GPL-3.0-or-later
"""The dense baseline and the sparse solver give the same direction."""

import numpy as np
import pytest
from scope.benchmarks.solver.dense import Dense
from scope.benchmarks.solver.loops import put
from scope.benchmarks.solver.problem import make_problem
from scope.solver.gauss_newton.linearize import linearize, make_blocks, make_pose
from scope.solver.gauss_newton.recursion import make_workspace, step


@pytest.mark.parametrize(
    ("K", "P", "N", "prior"),
    [(23, 10, 52, True), (23, 10, 120, False), (51, 10, 120, False), (23, 0, 120, False)],
)
def test_dense_and_sparse_steps_agree(K, P, N, prior):
    p = make_problem(K, P, N, prior)
    pose = make_pose(p.tree)
    blocks = make_blocks(p.tree)
    work = make_workspace(p.tree)
    dense = Dense(p)
    for k in (0, 5):
        put(p.bank, k, pose)
        linearize(p.tree, p.terms, p.stage, 0.0, pose, blocks, work.scratch)
        step(p.tree, pose, blocks, p.damping, p.root_scale, work)
        found = np.concatenate([work.x[0], work.u[1:].ravel(), work.dbeta[:P]])
        expected = dense.step(k)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
