# SPDX-License-Identifier: GPL-3.0-or-later
"""The linear-time step against a dense one that shares no code with it, and what it leaves; steps
of all kinds of measurements are compared in fitting/test_normal_equations.py.
"""

import numpy as np
import pytest
from scope.solver import Options, Priors, gauss_newton_step, rotations
from scope.solver.fitting.normal_equations import problem_of
from scope.solver.gauss_newton.linearize import linearize, make_blocks, make_pose
from scope.solver.gauss_newton.recursion import make_workspace, retract, step

from ..fitting.test_normal_equations import problem
from ..motion.clips import FLAT, noisy_clip
from ..motion.test_band import DAMPING, dense_step
from ..synthetic import forward


def test_step_equals_dense_step():
    clip = noisy_clip(0, frames=1, cameras=1)
    ((view,),) = clip.frames()
    d, d_shape, decrease, *_ = dense_step(clip, focal=False)
    found = gauss_newton_step(
        clip.body,
        view.measurements,
        clip.starts[0],
        priors=Priors(),
        options=FLAT,
        damping=DAMPING,
    )
    expected = np.append(d[0], d_shape)
    np.testing.assert_allclose(
        found.direction, expected, rtol=0, atol=1e-8 * np.abs(expected).max()
    )
    assert found.predicted_decrease == pytest.approx(decrease, rel=1e-8)


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
