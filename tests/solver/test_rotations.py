# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from scope.solver import rotations

RNG = np.random.default_rng(0)
AXES = RNG.standard_normal((20, 3))
AXES /= np.linalg.norm(AXES, axis=1)[:, None]
ANGLES = [0.0, 1e-12, 1e-8, 1e-5, 1e-3, 0.02, 0.099, 0.101, 0.45, 0.5, 0.55, 1.0, 2.0, 3.0, 3.13]
ANGLES += [np.pi - gap for gap in (1e-3, 1e-5, 1e-7, 1e-9)]
VECTORS = np.concatenate([angle * AXES for angle in ANGLES])


def exp_by_doubling(phi):
    """Power series of a 1/64 turn, squared six times."""
    A = rotations.hat(phi) / 64
    E = sum(
        (np.linalg.matrix_power(A, k) / float(np.prod(np.arange(1, k + 1))) for k in range(12)),
        np.zeros((3, 3)),
    )
    for _ in range(6):
        E = E @ E
    return E


def test_exp_is_the_matrix_exponential():
    expected = np.array([exp_by_doubling(v) for v in VECTORS])
    np.testing.assert_allclose(rotations.exp(VECTORS), expected, atol=2e-14, rtol=0)
    np.testing.assert_allclose(
        [rotations.exp3(*v) for v in VECTORS], expected.reshape(-1, 9), atol=2e-14, rtol=0
    )


def test_log_inverts_exp_up_to_pi():
    R = rotations.exp(VECTORS)
    np.testing.assert_allclose(rotations.log(R), VECTORS, atol=1e-9)
    np.testing.assert_allclose([rotations.log3(*r.ravel()) for r in R], VECTORS, atol=1e-9)


def test_log_at_pi_is_a_half_turn():
    for axis in (*np.eye(3), *-np.eye(3), *AXES):
        R = 2 * np.outer(axis, axis) - np.eye(3)
        for phi in (rotations.log(R), np.array(rotations.log3(*R.ravel()))):
            assert np.linalg.norm(phi) == pytest.approx(np.pi, abs=1e-9)
            np.testing.assert_allclose(rotations.exp(phi), R, atol=1e-9)


def test_the_left_jacobians_inverse_is_the_derivative_of_log():
    """log(exp(w) R) = log(R) + J^-1(log R) w."""
    h = 1e-6
    for phi in VECTORS[np.linalg.norm(VECTORS, axis=1) < np.pi - 1e-3]:
        R = rotations.exp(phi)
        numeric = [
            (rotations.log(rotations.exp(h * e) @ R) - rotations.log(rotations.exp(-h * e) @ R))
            / (2 * h)
            for e in np.eye(3)
        ]
        found = np.reshape(rotations.left_jacobian_inverse3(*phi), (3, 3))
        np.testing.assert_allclose(found, np.array(numeric).T, atol=2e-8)


def test_the_left_jacobians_inverse_is_finite_and_continuous_at_half_a_turn():
    for axis in AXES:
        near = rotations.left_jacobian_inverse3(*((np.pi - 1e-7) * axis))
        np.testing.assert_allclose(
            rotations.left_jacobian_inverse3(*(np.pi * axis)), near, atol=1e-6
        )


def test_quaternions_go_both_ways():
    R = rotations.exp(VECTORS)
    q = rotations.quaternion_from_matrix(R)
    half = np.linalg.norm(VECTORS, axis=1) / 2
    np.testing.assert_allclose(q[:, 0], np.cos(half), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-14)
    np.testing.assert_allclose(rotations.matrix_from_quaternion(3.0 * q), R, atol=1e-14)
    of_vectors = rotations.quaternion_from_rotation_vector(VECTORS)
    np.testing.assert_allclose(rotations.matrix_from_quaternion(of_vectors), R, atol=1e-14)


def test_nearest_rotation_repairs_and_survives_anything():
    R = rotations.exp(VECTORS)
    np.testing.assert_allclose(rotations.nearest_rotation(1.01 * R), R, atol=1e-13)
    broken = np.stack(
        [np.full((3, 3), np.nan), np.zeros((3, 3)), -np.eye(3), np.full((3, 3), np.inf)]
    )
    fixed = rotations.nearest_rotation(broken)
    np.testing.assert_allclose(np.linalg.det(fixed), 1, atol=1e-12)
    np.testing.assert_allclose(
        fixed @ np.swapaxes(fixed, 1, 2), np.tile(np.eye(3), (4, 1, 1)), atol=1e-12
    )


def test_the_shortest_turn_takes_one_direction_to_the_other_about_what_is_across_both():
    rng = np.random.default_rng(5)
    a, b = rng.standard_normal((2, 50, 3))
    # opposite
    a[0] = [1.0, 0, 0]
    b[0] = [-2.0, 0, 0]
    # the same
    a[1] = [0, 3.0, 0]
    b[1] = [0, 1.0, 0]
    R = rotations.shortest_turn(a, b)
    unit = lambda v: v / np.linalg.norm(v, axis=-1, keepdims=True)  # noqa: E731
    np.testing.assert_allclose(np.einsum("nij,nj->ni", R, unit(a)), unit(b), atol=1e-9)
    angle = np.arccos(np.clip((unit(a) * unit(b)).sum(-1), -1, 1))
    np.testing.assert_allclose(np.linalg.norm(rotations.log(R), axis=-1), angle, atol=1e-6)
    np.testing.assert_allclose(R[1], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotations.shortest_turn(a[7], b[7]), R[7], atol=1e-12)
    np.testing.assert_allclose(
        rotations.shortest_turn(*np.reshape([a, b], (2, 5, 10, 3))), R.reshape(5, 10, 3, 3)
    )


def test_small_angles_have_all_their_digits():
    """At 0.03 rad, where the kernel's logarithm is a series, its fourth term is 3e-11 of the
    angle.
    """
    vectors = 0.03 * AXES
    rotation_matrices = np.array([exp_by_doubling(v) for v in vectors])
    for found in (
        rotations.log(rotation_matrices),
        [rotations.log3(*r.ravel()) for r in rotation_matrices],
    ):
        np.testing.assert_allclose(found, vectors, rtol=0.0, atol=0.03 * 1e-12)


def test_nearly_orthonormal_matrices_become_the_nearest_rotations():
    """The nearest rotation is the polar factor, here by singular values; a step's error is that of
    before, squared.
    """
    rng = np.random.default_rng(6)
    matrices = rotations.exp(rng.uniform(-3.0, 3.0, (40, 3))) + 1e-8 * rng.standard_normal(
        (40, 3, 3)
    )
    U, _, Vt = np.linalg.svd(matrices)
    assert rotations.orthonormalize(matrices)
    np.testing.assert_allclose(matrices, U @ Vt, atol=4e-15)


@pytest.mark.parametrize("column", range(3))
def test_what_is_no_rotation_is_not_made_orthonormal(column):
    """A longer axis, two axes that are not at right angles, and a reflection, which is orthonormal
    as well.
    """
    turn = rotations.exp([0.9, -0.7, 1.3])
    longer = turn.copy()
    slanted = turn.copy()
    mirrored = turn.copy()
    longer[:, column] *= 1.0 + 1e-6
    slanted[:, column] += 1e-6 * turn[:, column - 1]
    mirrored[:, column] *= -1.0
    for matrix in (longer, slanted, mirrored, np.full((3, 3), np.nan)):
        both = np.array([turn, matrix])
        assert not rotations.orthonormalize(both)
        np.testing.assert_array_equal(both[1], matrix)
    assert rotations.orthonormalize(turn[None].copy())
