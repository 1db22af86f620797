# SPDX-License-Identifier: GPL-3.0-or-later
"""Conjugate gradients on a clip lead to the step of the elimination over time."""

import numpy as np
from scope.benchmarks.solver.clip_gradients import ConjugateGradients
from scope.benchmarks.solver.clip_steps import make_clip
from scope.solver.motion.band import make_factor, solve_clip


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
