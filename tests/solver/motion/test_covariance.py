# SPDX-License-Identifier: GPL-3.0-or-later
"""Marginal covariances against the dense inverse of the normal equations."""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver.gauss_newton.optimizer import MIN_DAMPING
from scope.solver.motion.band import make_factor
from scope.solver.motion.covariance import joint_covariances
from scope.solver.motion.system import GLOBALS

from ..dense import H as TINY
from ..dense import moved
from ..synthetic import forward
from .clips import PRIOR, K, P, noisy_clip
from .test_band import dense_step


def test_covariance_is_that_of_the_dense_inverse():
    clip = noisy_clip(4, frames=5)
    problem, poses, system = clip.problem()
    problem.linearize(0, poses, system)
    found, from_root, shared = joint_covariances(
        problem.tree, system, poses, 1.0, make_factor(system)
    )
    _, _, _, H = dense_step(clip)
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


def dense_matrix(system, T):
    """The symmetric matrix (T n + G, T n + G) that a system stands for."""
    n = 6 + 3 * K
    G = P + 1
    A = np.zeros((T * n + G, T * n + G))
    slots = [0, *range(6, n, 3), 3]
    for f in range(T):
        here = slice(f * n, (f + 1) * n)
        A[here, here] = np.triu(system.D[f, :n, :n])
        if f > 0:
            for block, at in zip(system.B1[f], slots, strict=True):
                A[(f - 1) * n + at : (f - 1) * n + at + 3, f * n + at : f * n + at + 3] = block.T
            w, _, J, columns, counts = system.contacts
            for k, m in enumerate(counts):
                own = J[f, k, :, :m]
                before = J[f - 1, k, :, :m]
                A[np.ix_((f - 1) * n + columns[k, :m], f * n + columns[k, :m])] -= (
                    w[f, k] * before.T @ own
                )
        if f > 1:
            for block, at in zip(system.B2[f], slots, strict=True):
                A[(f - 2) * n + at : (f - 2) * n + at + 3, f * n + at : f * n + at + 3] = block.T
        A[here, T * n :] = system.N[f, :n, 4 : 4 + G]
    A[T * n :, T * n :] = np.triu(system.C[:G, :G])
    return np.triu(A) + np.triu(A, 1).T


def test_covariances_far_from_the_middle_of_a_long_clip_are_exact():
    T = 30
    n = 6 + 3 * K
    clip = noisy_clip(4, frames=T, cameras=1)
    stiff = replace(
        PRIOR, joints=30.0, root_rotation=30.0, root_position=500.0, robust_joints=np.inf
    )
    problem, poses, system = clip.problem(stiff)
    problem.linearize(0, poses, system)
    found, _, _ = joint_covariances(problem.tree, system, poses, 1.0, make_factor(system))
    S = np.linalg.inv(dense_matrix(system, T))
    for f in (0, T // 2, T - 1):
        # the pelvis moves as its twist says
        expected = S[f * n + 3 : f * n + 6, f * n + 3 : f * n + 6]
        np.testing.assert_allclose(found[f, 0], expected, rtol=1e-6)
        assert (np.linalg.eigvalsh(found[f]) > 0.0).all()


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
    T, n = len(clip.times), 6 + 3 * K
    H = dense_matrix(system, T) + MIN_DAMPING * np.diag(np.r_[np.ones(T * n), np.zeros(P + 1)])
    rows = np.r_[: T * n, T * n + known]
    S = np.linalg.inv(H[np.ix_(rows, rows)])
    np.testing.assert_allclose(shared[np.ix_(known, known)], S[T * n :, T * n :], rtol=1e-6)
    # metres^2: the column moves every joint but the root
    assert (np.trace(found[:, 1:], axis1=2, axis2=3) > 1e4).all()
    assert (np.trace(from_root[:, 1:], axis1=2, axis2=3) > 1e4).all()
