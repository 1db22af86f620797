# SPDX-License-Identifier: GPL-3.0-or-later
"""What a step leaves; that it is the right one, fitting/test_normal_equations.py says."""

import numpy as np
from scope.solver import Options, rotations
from scope.solver.fitting.normal_equations import problem_of
from scope.solver.gauss_newton.linearize import linearize, make_blocks, make_pose
from scope.solver.gauss_newton.recursion import make_workspace, retract, step

from ..fitting.test_normal_equations import problem
from ..synthetic import forward


def test_twists_of_parts_follow_from_a_step_that_leaves_the_blocks_as_they_are():
    body, state, seen, priors = problem(5, 9, 4, 40)
    tree, terms, stage = problem_of(body, seen, priors, Options())
    pose = state.pose(tree)
    trial = make_pose(tree)
    blocks = make_blocks(tree)
    work = make_workspace(tree)
    linearize(tree, terms, stage, pose, blocks, work.scratch)
    first = step(tree, pose, blocks, 1.0, 3.0, work)
    assert step(tree, pose, blocks, 500.0, 3.0, work) < first
    assert step(tree, pose, blocks, 1.0, 3.0, work) == first
    for array in (work.x, work.u, work.dbeta):
        array *= 1e-7
    retract(tree, pose, work, trial)
    R, t, _ = forward(body, trial.R[0], trial.t[0], trial.Omega[1:], trial.beta[:4])
    for i in range(10):
        w = work.x[i, :3]
        nu = work.x[i, 3:]
        np.testing.assert_allclose(rotations.log(R[i] @ pose.R[i].T), w, atol=1e-12)
        expected = np.cross(w, pose.t[i] - pose.t[0]) + nu + pose.D[i, :, :4] @ work.dbeta[:4]
        np.testing.assert_allclose(t[i] - pose.t[i], expected, atol=1e-12)
