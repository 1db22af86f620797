# SPDX-License-Identifier: GPL-3.0-or-later
"""The public normal equations and step of a frame, against differences of the cost and a dense
solution.
"""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    InvalidValueError,
    Keypoints3D,
    Measurements,
    Options,
    PosePriors,
    Priors,
    ShapeError,
    State,
    Weights,
    gauss_newton_step,
    linearize,
    make_tree,
    register_residual,
    rotations,
)
from scope.solver.fitting.normal_equations import moved

from ..synthetic import forward, random_body, random_state
from .test_frame_solver import measured

OPTIONS = Options(weights=Weights(joint_limits=0.0))


def problem(seed, K, P, M, noise=1.0):
    """A body, a state, and measurements and priors of all kinds, from which it is as far as `noise`
    says.
    """
    rng = np.random.default_rng(seed)
    body = random_body(rng, K, P, M)
    state = State(*random_state(rng, K, P))
    R, t, _ = forward(body, *vars(state).values())
    seen = measured(body, vars(state).values(), noise, seed)
    turns = rotations.exp(0.3 * noise * rng.standard_normal((K + 1, 3)))
    part = K // 2
    pose = PosePriors([part], [R[part] @ turns[0]], [t[part] + 0.1 * noise], [70.0], [90.0])
    L = rng.standard_normal((P, P))
    priors = Priors(
        state.Omega @ turns[1:],
        rng.uniform(0.5, 2.0, K),
        state.beta + noise * rng.standard_normal(P),
        L @ L.T + np.eye(P),
    )
    return body, state, replace(seen, pose_priors=pose), priors


def test_the_gradient_is_that_of_the_cost_and_the_hessian_where_all_is_explained_that_of_it():
    """Of robust kernels too; there, the Hessian of Gauss-Newton is the whole one."""
    h = 1e-6
    for noise in (1.0, 0.0):
        body, state, seen, priors = problem(2, 7, 5, 24, noise)
        tree = make_tree(body)

        def at(d, body=body, state=state, seen=seen, priors=priors, tree=tree):
            there = moved(tree, state, d)
            return linearize(body, seen, there, priors=priors, options=OPTIONS)

        found = at(np.zeros(32))
        for k, step in enumerate(h * np.eye(32)):
            ahead = at(step)
            behind = at(-step)
            slope = (ahead.cost - behind.cost) / (2.0 * h)
            assert found.g[k] == pytest.approx(slope, rel=1e-5, abs=1e-3), k
            if noise == 0.0:
                column = (ahead.g - behind.g) / (2.0 * h)
                scale = np.abs(found.H).max()
                np.testing.assert_allclose(found.H[:, k], column, rtol=0, atol=1e-6 * scale)


def check_step(body, state, seen, priors):
    """The recursion's step is the dense one of the equations, damped or not."""
    given = {"priors": priors, "options": OPTIONS}
    equations = linearize(body, seen, state, **given)
    K = len(state.Omega)
    root = np.full(3, 1.0 / OPTIONS.root_length**2)
    damped = np.concatenate([np.ones(3), root, np.ones(3 * K), np.zeros(len(state.beta))])
    for damping in (0.0, 40.0):
        step = gauss_newton_step(body, seen, state, damping=damping, **given)
        expected = -np.linalg.solve(equations.H + damping * np.diag(damped), equations.g)
        largest = np.abs(expected).max()
        np.testing.assert_allclose(step.direction, expected, rtol=0, atol=1e-8 * largest)
        quadratic = -equations.g @ expected - 0.5 * expected @ equations.H @ expected
        assert step.predicted_decrease == pytest.approx(quadratic, rel=1e-8)


@pytest.mark.parametrize(("K", "P", "M"), [(23, 10, 60), (51, 0, 104), (1, 3, 20)])
def test_the_step_solves_the_equations(K, P, M):
    check_step(*problem(1, K, P, M))


def test_the_step_solves_equations_that_couple_a_joint_with_its_part():
    """As residuals of one's own do, whose derivatives test_residual_check.py compares."""

    def coupled(part, ints, floats):
        turn = rotations.log(part.R @ part.Omega)
        return floats[0] * np.concatenate([part.t, part.beta, turn, part.beta.sum() * turn])

    register_residual("coupled", function=coupled)
    body, state, seen, priors = problem(4, 7, 5, 24)
    rows = np.arange(8)[:, None], np.linspace(3.0, 9.0, 8)[:, None]
    check_step(body, state, replace(seen, tables={"coupled": rows}), priors)


def test_the_moved_state_follows_the_direction():
    """Omega <- R_parᵀ exp(u) R_par Omega and the root's twist about the pelvis, by hand."""
    body, start, seen, priors = problem(3, 4, 3, 20)
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
    body, start, seen, priors = problem(3, 4, 3, 20)
    with pytest.raises(InvalidValueError, match="damping must be finite and not negative"):
        gauss_newton_step(body, seen, start, priors=priors, damping=-1.0)
    with pytest.raises(InvalidValueError, match="measurements must be Measurements"):
        linearize(body, [seen], start, priors=priors)
    with pytest.raises(ShapeError, match="beta must have shape"):
        linearize(body, seen, replace(start, beta=np.zeros(2)), priors=priors)
    beyond = Measurements(keypoints3d=Keypoints3D([99], [[0.0, 0.0, 3.0]]))
    with pytest.raises(ShapeError, match="Indices of 3D keypoints must lie in"):
        linearize(body, beyond, start, priors=priors)
