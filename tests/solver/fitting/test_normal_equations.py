# SPDX-License-Identifier: GPL-3.0-or-later
"""The public normal equations and step of a frame, against dense ones that share no code with them
and against differences of the cost.
"""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    InvalidValueError,
    Keypoints3D,
    Measurements,
    Options,
    ShapeError,
    State,
    Weights,
    gauss_newton_step,
    linearize,
    register_residual,
    rotations,
)

from ..gauss_newton.test_recursion import dense_system, problem

OPTIONS = Options(weights=Weights(joint_limits=0.0))


@pytest.mark.parametrize(("K", "P", "M"), [(23, 10, 40), (9, 0, 24), (1, 3, 20)])
def test_they_equal_dense_ones(K, P, M):
    _, body, state, _, _, _, raw, sigmas, scales, priors, weights, seen = problem(1, K, P, M)
    J, r, cost = dense_system(body, state, raw, sigmas, scales, priors, weights)
    found = linearize(body, seen, State(*state), priors=priors, options=OPTIONS)
    assert found.cost == pytest.approx(cost, rel=1e-11)
    scale = np.abs(J.T @ J).max()
    np.testing.assert_allclose(found.H, J.T @ J, rtol=0, atol=1e-10 * scale)
    np.testing.assert_allclose(found.g, J.T @ r, rtol=0, atol=1e-10 * np.abs(J.T @ r).max())
    for damping in (0.0, 40.0):
        root = np.full(3, damping / OPTIONS.root_length**2)
        Lambda = np.concatenate([np.full(3, damping), root, np.full(3 * K, damping), np.zeros(P)])
        expected = -np.linalg.solve(J.T @ J + np.diag(Lambda), J.T @ r)
        step = gauss_newton_step(
            body, seen, State(*state), priors=priors, options=OPTIONS, damping=damping
        )
        largest = np.abs(expected).max()
        np.testing.assert_allclose(step.direction, expected, rtol=0, atol=1e-8 * largest)
        quadratic = -(J.T @ r) @ expected - 0.5 * expected @ (J.T @ J) @ expected
        assert step.predicted_decrease == pytest.approx(quadratic, rel=1e-9)


def test_the_step_solves_equations_that_couple_a_joint_with_its_part():
    """As residuals of one's own do, whose derivatives test_residual_check.py compares."""
    _, body, state, *_, priors, _, seen = problem(4, 7, 5, 24)

    def coupled(part, ints, floats):
        turn = rotations.log(part.R @ part.Omega)
        return floats[0] * np.concatenate([part.t, part.beta, turn, part.beta.sum() * turn])

    register_residual("coupled", function=coupled)
    rows = np.arange(8)[:, None], np.linspace(3.0, 9.0, 8)[:, None]
    seen = replace(seen, tables={"coupled": rows})
    start = State(*state)
    equations = linearize(body, seen, start, priors=priors, options=OPTIONS)
    for damping in (0.0, 40.0):
        step = gauss_newton_step(body, seen, start, priors=priors, options=OPTIONS, damping=damping)
        root = np.full(3, damping / OPTIONS.root_length**2)
        Lambda = np.concatenate([np.full(3, damping), root, np.full(21, damping), np.zeros(5)])
        expected = -np.linalg.solve(equations.H + np.diag(Lambda), equations.g)
        np.testing.assert_allclose(
            step.direction, expected, rtol=0, atol=1e-8 * np.abs(expected).max()
        )


def test_the_moved_state_follows_the_direction():
    """Omega <- R_parᵀ exp(u) R_par Omega and the root's twist about the pelvis, by hand."""
    _, body, state, *_, priors, _, seen = problem(3, 4, 3, 20)
    start = State(*state)
    step = gauss_newton_step(body, seen, start, priors=priors, options=OPTIONS, damping=1e3)
    d = step.direction
    R = [start.R_camera_root]
    for i in range(1, 5):
        up = R[body.parents[i]]
        R.append(up @ start.Omega[i - 1])
        u = d[3 + 3 * i : 6 + 3 * i]
        expected = up.T @ rotations.exp(u) @ up @ start.Omega[i - 1]
        np.testing.assert_allclose(step.state.Omega[i - 1], expected, atol=1e-12)
    np.testing.assert_allclose(step.state.R_camera_root, rotations.exp(d[:3]) @ R[0], atol=1e-12)
    np.testing.assert_allclose(step.state.t_camera_root, start.t_camera_root + d[3:6])
    np.testing.assert_allclose(step.state.beta, start.beta + d[18:])
    before = linearize(body, seen, start, priors=priors, options=OPTIONS).cost
    after = linearize(body, seen, step.state, priors=priors, options=OPTIONS).cost
    assert after < before


def test_what_cannot_be_linearized_is_refused():
    _, body, state, *_, priors, _, seen = problem(3, 4, 3, 20)
    start = State(*state)
    with pytest.raises(InvalidValueError, match="damping must be finite and not negative"):
        gauss_newton_step(body, seen, start, priors=priors, damping=-1.0)
    with pytest.raises(InvalidValueError, match="measurements must be Measurements"):
        linearize(body, [seen], start, priors=priors)
    with pytest.raises(ShapeError, match="beta must have shape"):
        linearize(body, seen, replace(start, beta=np.zeros(2)), priors=priors)
    beyond = Measurements(keypoints3d=Keypoints3D([99], [[0.0, 0.0, 3.0]]))
    with pytest.raises(ShapeError, match="Indices of 3D keypoints must lie in"):
        linearize(body, beyond, start, priors=priors)
