# SPDX-License-Identifier: GPL-3.0-or-later
"""A clip's objective and its gradient, against the definition and finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import rotations

from ..synthetic import forward
from .clips import K, P, cost_of, gauss_newton_residuals, noisy_clip


def turned(body, state, d):
    """The state moved by d = (w, nu, u_1..K, dbeta), with rotations that stay rotations."""
    R0, t0, Omega, beta = state
    R, _, _ = forward(body, R0, t0, Omega, beta)
    u = d[6 : 6 + 3 * K].reshape(K, 3)
    parents = [R[body.parents[i + 1]] for i in range(K)]
    Omega = np.array([rotations.exp(Q.T @ u[i]) @ Omega[i] for i, Q in enumerate(parents)])
    return rotations.exp(d[:3]) @ R0, t0 + d[3:6], Omega, beta + d[6 + 3 * K :]


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "cameras"), [(0, 2), (1, 1)])
def test_gradient_of_the_clips_whole_objective_by_finite_differences(seed, cameras):
    clip = noisy_clip(seed, cameras=cameras)
    problem, poses, system = clip.problem()
    cost = problem.linearize(0, poses, system)
    n = 6 + 3 * K
    T = len(clip.times)
    residuals = gauss_newton_residuals(clip)

    def objective(d):
        return cost_of(residuals(d, turned))

    assert cost == pytest.approx(objective(np.zeros(T * n + P + 1)), rel=1e-11)
    expected = np.zeros(T * n + P + 1)
    h = 1e-5
    for k in range(len(expected)):
        d = np.zeros(len(expected))
        d[k] = h
        expected[k] = (objective(d) - objective(-d)) / (2 * h)
    found = np.concatenate([system.N[:, :n, 0].ravel(), system.c[: P + 1]])
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
    assert np.abs(expected).max() > 100.0


def test_a_weight_means_the_same_at_any_frame_rate():
    """Of one motion sampled twice as often, the integrals hardly change."""
    costs = []
    for frames in (60, 120):
        clip = noisy_clip(3, frames=frames, cameras=1)
        times = np.linspace(0.0, 2.0, frames)
        for f, t in enumerate(times):
            s = clip.starts[0]
            angle = 0.3 * np.sin(3.0 * t) * np.ones((K, 3))
            clip.starts[f] = type(s)(
                rotations.exp(np.array([0.0, 0.5 * np.sin(2.0 * t), 0.0])),
                np.array([0.2 * np.sin(4.0 * t), 0.0, 4.0]),
                rotations.exp(angle),
                s.beta,
            )
        clip.times = times
        problem, poses, system = clip.problem(focal=False)
        problem.motion.probability[1:] = 0.5
        problem.linearize(0, poses, system)
        costs.append((problem.costs["acceleration"], problem.costs["contact"]))
    np.testing.assert_allclose(costs[0], costs[1], rtol=0.05)


def test_a_part_of_a_clip_knows_nothing_of_the_frame_before_it():
    """Its Hessian and gradient are those of a clip that begins there; standing points had added to
    the first frame's Hessian, without a cost.
    """
    clip = noisy_clip(2, frames=7)
    problem, _, _ = clip.problem()
    first = 3
    later = replace(
        clip,
        starts=clip.starts[first:],
        times=clip.times[first:],
        pixels=[each[first:] for each in clip.pixels],
        points=clip.points[first:],
        stands=replace(clip.stands, probability=clip.stands.probability[first:]),
    )
    alone, poses, expected = later.problem()
    alone.linearize(0, poses, expected)
    part, poses, found = later.problem()
    part.motion = problem.motion.part(slice(first, 7))
    part.linearize(0, poses, found)
    np.testing.assert_allclose(found.D, expected.D, rtol=1e-12)
    np.testing.assert_allclose(found.N, expected.N, rtol=1e-12)
