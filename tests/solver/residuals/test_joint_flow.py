# SPDX-License-Identifier: GPL-3.0-or-later
"""The joint flow as a density on SO(3): a diffeomorphism, its volume, half turns, and the vector
kernel.
"""

import numpy as np
import pytest
from scope.solver import State, make_tree, rotations
from scope.solver.gauss_newton.linearize import make_blocks
from scope.solver.residuals import joint_flow as jf

from ..synthetic import random_body, random_flow, random_state

MEAN = rotations.exp([0.4, -0.3, 0.8])
FLOW = random_flow(np.random.default_rng(5), MEAN)
HAAR_PER_RADIAN3 = 1.0 / (8.0 * np.pi**2)  # dmu = d^3w / (8 pi^2) for R <- exp(w) R


def uniform_rotations(rng, n):
    return rotations.matrix_from_quaternion(rng.standard_normal((n, 4)))


def test_every_value_has_its_state_and_every_state_its_value():
    rng = np.random.default_rng(0)
    z = 3.0 * rng.standard_normal((400, 3))
    np.testing.assert_allclose(jf.transform(FLOW, jf.invert(FLOW, z))[0], z, rtol=1e-9, atol=1e-9)
    Omega = uniform_rotations(rng, 400)
    np.testing.assert_allclose(jf.invert(FLOW, jf.transform(FLOW, Omega)[0]), Omega, atol=1e-8)


def test_log_determinant_is_that_of_the_numeric_derivative():
    Omega = uniform_rotations(np.random.default_rng(1), 50)
    h = 1e-6
    _, J, log_det = jf.transform(FLOW, Omega)
    up = [jf.transform(FLOW, rotations.exp(h * e) @ Omega) for e in np.eye(3)]
    down = [jf.transform(FLOW, rotations.exp(-h * e) @ Omega) for e in np.eye(3)]
    numeric = np.stack([(a[0] - b[0]) / (2 * h) for a, b in zip(up, down, strict=True)], -1)
    np.testing.assert_allclose(J, numeric, atol=1e-7 * np.abs(numeric).max())
    np.testing.assert_allclose(
        log_det, np.linalg.slogdet(numeric)[1] - np.log(HAAR_PER_RADIAN3), atol=1e-6
    )
    assert (np.linalg.det(J) > 0).all() or (np.linalg.det(J) < 0).all()


def test_density_integrates_to_one_over_all_rotations():
    density = np.exp(jf.log_density(FLOW, uniform_rotations(np.random.default_rng(2), 30_000)))
    assert density.mean() == pytest.approx(1.0, abs=4.0 * density.std() / np.sqrt(len(density)))
    assert density.std() > 0.5  # it is not the uniform density


def test_samples_have_the_density():
    """Expectations by samples and by weighted uniform rotations agree."""
    rng = np.random.default_rng(3)
    drawn = jf.invert(FLOW, rng.standard_normal((30_000, 3)))
    uniform = uniform_rotations(rng, 100_000)
    weighted = np.einsum("n,nij->ij", np.exp(jf.log_density(FLOW, uniform)), uniform) / len(uniform)
    np.testing.assert_allclose(drawn.mean(0), weighted, atol=0.02)


def test_residual_grows_to_the_half_turn_and_stays_finite_there():
    """|z| rises over the last part of the way, J stays finite, and the states within 1e-4 of pi
    count as at that.
    """
    axis = np.array([0.6, -0.48, 0.64])
    angles = np.pi - np.array([0.5, 0.1, 1e-2, 1e-3, 2e-4])
    length = [np.linalg.norm(jf.transform(FLOW, MEAN @ rotations.exp(a * axis))[0]) for a in angles]
    assert (np.diff(length) > 0).all()
    assert length[-1] > 30.0
    last = jf.transform(FLOW, MEAN @ rotations.exp((np.pi - jf.NEAREST) * axis))
    for gap in (5e-5, 1e-9, 0.0):
        for sign in (1.0, -1.0):
            found = jf.transform(FLOW, MEAN @ rotations.exp(sign * (np.pi - gap) * axis))
            assert all(np.isfinite(v).all() for v in found)
            if gap > 0.0 and sign > 0.0:
                np.testing.assert_allclose(found[0], last[0], rtol=1e-6)


def test_vector_kernel_agrees_with_numpy_joint_by_joint_also_at_half_turns():
    rng = np.random.default_rng(4)
    K = 11  # two rows, the second one not full
    body = random_body(rng, K, 0, 0)
    tree = make_tree(body)
    flows = np.array([random_flow(rng, rotations.exp(rng.standard_normal(3))) for _ in range(K)])
    means = flows[:, :9].reshape(K, 3, 3)
    R0, t0, Omega, _ = random_state(rng, K, 0)
    Omega[2] = means[2] @ rotations.exp([0.0, np.pi, 0.0])
    Omega[7] = means[7] @ rotations.exp((np.pi - 2e-5) * np.array([0.36, -0.48, 0.8]))
    Omega[9] = means[9]
    pose = State(R0, t0, Omega, np.zeros(0)).pose(tree)
    weights = rng.uniform(0.5, 2.0, K)
    weights[5] = 0.0
    blocks = make_blocks(tree)
    cost = jf.accumulate(tree, *jf.pack(np.arange(1, K + 1), flows, weights), 1.3, pose, blocks)
    expected = 0.0
    for i in range(1, K + 1):
        z, J, _ = jf.transform(flows[i - 1], pose.Omega[i])
        w = 1.3 * weights[i - 1]
        R = pose.R[tree.parents[i]]
        expected += 0.5 * w * z @ z
        np.testing.assert_allclose(
            blocks.H_u[i, :, 6], w * R @ J.T @ z, rtol=1e-6, atol=1e-9, err_msg=str(i)
        )
        H = w * R @ J.T @ J @ R.T
        np.testing.assert_allclose(
            blocks.H_uu[i], H, rtol=1e-6, atol=1e-9 * np.abs(H).max() + 1e-12
        )
    assert cost == pytest.approx(expected, rel=1e-6)
