# SPDX-License-Identifier: GPL-3.0-or-later
"""Marginal covariances against the dense inverse of the normal equations."""

import numpy as np
import pytest
from scope.solver.gauss_newton.optimizer import MIN_DAMPING
from scope.solver.motion.band import make_factor, solve_clip
from scope.solver.motion.covariance import joint_covariances
from scope.solver.motion.system import GLOBALS

from ..dense import H as TINY
from ..dense import moved
from ..synthetic import forward
from .clips import K, P, noisy_clip
from .test_band import dense_step


def test_covariance_is_that_of_the_dense_inverse():
    clip = noisy_clip(4, frames=5)
    problem, poses, system = clip.problem()
    problem.linearize(0, poses, system)
    found, from_root, shared = joint_covariances(
        problem.tree, system, poses, 1.0, make_factor(system)
    )
    _, _, _, H, _ = dense_step(clip)
    n = 6 + 3 * K
    T = len(clip.times)
    S = np.linalg.inv(H + MIN_DAMPING * np.diag(np.r_[np.ones(T * n), np.zeros(P + 1)]))
    np.testing.assert_allclose(
        shared, S[T * n :, T * n :], rtol=1e-6, atol=1e-9 * np.abs(shared).max()
    )
    for f, s in enumerate(clip.starts):
        state = (s.R_camera_root, s.t_camera_root, s.Omega, s.beta)
        rows = np.r_[f * n : (f + 1) * n, T * n : T * n + P]
        J = np.empty((K + 1, 3, len(rows)))
        for k in range(len(rows)):
            d = np.zeros(len(rows), complex)
            d[k] = 1j * TINY
            J[:, :, k] = np.imag(forward(clip.body, *moved(clip.body, state, d))[1]) / TINY
        expected = J @ S[np.ix_(rows, rows)] @ J.transpose(0, 2, 1)
        np.testing.assert_allclose(
            found[f], expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max()
        )
        J -= J[:1].copy()
        expected = J @ S[np.ix_(rows, rows)] @ J.transpose(0, 2, 1)
        np.testing.assert_allclose(
            from_root[f], expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max()
        )


def test_covariances_of_a_long_clip_are_those_of_its_steps():
    """A column of the inverse is the step for a force on that unknown; rounding does not add up
    from the middle of the clip to its ends.
    """
    clip = noisy_clip(4, frames=160)
    problem, poses, system = clip.problem()
    problem.linearize(0, poses, system)
    factor = make_factor(system)
    found = joint_covariances(problem.tree, system, poses, 1.0, factor).joints
    system.c[:] = 0.0
    for f in (0, 159):
        expected = np.empty((3, 3))
        for axis in range(3):
            system.N[:, :, 0] = 0.0
            system.N[f, 3 + axis, 0] = -1.0
            solve_clip(problem.tree, system, MIN_DAMPING, 1.0, factor)
            expected[axis] = factor.d[f, 3:6]
        np.testing.assert_allclose(
            found[f, 0], expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max()
        )


def test_a_column_of_the_shape_that_nothing_fixes_is_unknown():
    clip = noisy_clip(4, frames=5)
    problem, poses, system = clip.problem()
    problem.linearize(0, poses, system)
    column = P - 1
    system.N[:, :, GLOBALS + column] = 0.0
    system.C[column, :] = 0.0
    system.C[:, column] = 0.0
    found, from_root, shared = joint_covariances(
        problem.tree, system, poses, 1.0, make_factor(system)
    )
    assert shared[column, column] == pytest.approx(1.0 / MIN_DAMPING)
    known = np.delete(np.arange(P + 1), column)
    _, _, _, H, _ = dense_step(clip)
    poses_end = len(H) - (P + 1)
    rows = np.r_[:poses_end, poses_end + known]
    damping = MIN_DAMPING * (rows < poses_end)
    S = np.linalg.inv(H[np.ix_(rows, rows)] + np.diag(damping))
    expected = S[poses_end:, poses_end:]
    np.testing.assert_allclose(
        shared[np.ix_(known, known)], expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max()
    )
    # metres^2: the column moves every joint but the root
    assert (np.trace(found[:, 1:], axis1=2, axis2=3) > 1e4).all()
    assert (np.trace(from_root[:, 1:], axis1=2, axis2=3) > 1e4).all()
