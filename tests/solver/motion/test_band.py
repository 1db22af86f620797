# SPDX-License-Identifier: GPL-3.0-or-later
"""The step of a clip against a dense solve."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scope.solver.motion.band import make_factor, solve_clip

from ..dense import H
from .clips import K, P, cost_of, gauss_newton_residuals, kernel, noisy_clip

DAMPING = 3.0
ROOT_SCALE = 1 / 0.3


def dense_step(clip, focal=True):
    """Return (poses' steps (T, n), globals' step, predicted decrease) by one dense solve, the
    Hessian and the cost.
    """
    residuals = gauss_newton_residuals(clip, focal=focal)
    n = 6 + 3 * K
    T = len(clip.times)
    size = T * n + P + focal
    at_rest = residuals(np.zeros(size))
    factors = [np.sqrt(w * kernel(r, sigma)[1])[:, None] for r, w, sigma in at_rest]

    def stacked(d):
        return np.concatenate(
            [(a * r).ravel() for a, (r, _, _) in zip(factors, residuals(d), strict=True)]
        )

    J = np.empty((len(stacked(np.zeros(size))), size))
    for k in range(size):
        d = np.zeros(size, complex)
        d[k] = 1j * H
        J[:, k] = np.imag(stacked(d)) / H
    JTJ = J.T @ J
    g = J.T @ np.real(stacked(np.zeros(size)))
    damped = np.zeros(size)
    damped[: T * n] = np.tile(
        DAMPING * np.r_[np.ones(3), np.full(3, ROOT_SCALE**2), np.ones(3 * K)], T
    )
    d = -np.linalg.solve(JTJ + np.diag(damped), g)
    return d[: T * n].reshape(T, n), d[T * n :], -g @ d - 0.5 * d @ JTJ @ d, JTJ, cost_of(at_rest)


@pytest.mark.parametrize("frames", [1, 2, 3, 6])
def test_step_is_the_dense_step_of_the_clip(frames):
    clip = noisy_clip(frames, frames=frames)
    problem, poses, system = clip.problem()
    cost = problem.linearize(0, poses, system)
    factor = make_factor(system)
    predicted = solve_clip(problem.tree, system, DAMPING, ROOT_SCALE, factor)
    d, dg, decrease, _, expected_cost = dense_step(clip)
    assert cost == pytest.approx(expected_cost, rel=1e-11)
    scale = max(np.abs(d).max(), np.abs(dg).max())
    np.testing.assert_allclose(factor.d[:, : d.shape[1]], d, atol=1e-8 * scale)
    np.testing.assert_allclose(factor.dg[: P + 1], dg, atol=1e-8 * scale)
    assert predicted == pytest.approx(decrease, rel=1e-8)
    assert not factor.d[:, d.shape[1] :].any()


def test_two_threads_give_the_same_step_bit_by_bit():
    clip = noisy_clip(9, frames=9)
    steps = []
    with ThreadPoolExecutor(2) as pool:
        for used in (None, pool):
            problem, poses, system = clip.problem(pool=used)
            problem.linearize(0, poses, system)
            factor = make_factor(system)
            solve_clip(problem.tree, system, DAMPING, ROOT_SCALE, factor, used)
            steps.append(factor.d.copy())
    np.testing.assert_array_equal(steps[0], steps[1])
