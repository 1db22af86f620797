# SPDX-License-Identifier: GPL-3.0-or-later
"""Marginal covariances against the dense inverse of the normal equations."""

import numpy as np
from scope.solver.gauss_newton.optimizer import DAMPING_LEAST
from scope.solver.motion.band import make_factor
from scope.solver.motion.covariance import joint_covariances

from ..dense import H as TINY
from ..dense import moved
from ..synthetic import forward
from .clips import K, P, noisy_clip
from .test_band import dense_step


def test_covariance_is_that_of_the_dense_inverse():
    clip = noisy_clip(4, frames=7)
    problem, poses, system = clip.problem()
    problem.linearize(0, poses, system)
    found, shared = joint_covariances(problem.tree, system, poses, 1.0, make_factor(system))
    _, _, _, H = dense_step(clip)
    n, T = 6 + 3 * K, len(clip.times)
    S = np.linalg.inv(H + DAMPING_LEAST * np.diag(np.r_[np.ones(T * n), np.zeros(P + 1)]))
    np.testing.assert_allclose(shared, S[T * n :, T * n :], rtol=1e-6, atol=1e-9 * np.abs(shared).max())
    for f, s in enumerate(clip.starts):
        state = (s.R_camera_root, s.t_camera_root, s.Omega, s.beta)
        rows = np.r_[f * n : (f + 1) * n, T * n : T * n + P]
        J = np.empty((K + 1, 3, len(rows)))
        for k in range(len(rows)):
            d = np.zeros(len(rows), complex)
            d[k] = 1j * TINY
            J[:, :, k] = np.imag(forward(clip.body, *moved(clip.body, state, d))[1]) / TINY
        expected = J @ S[np.ix_(rows, rows)] @ J.transpose(0, 2, 1)
        np.testing.assert_allclose(found[f], expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())
