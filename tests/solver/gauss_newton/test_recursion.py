# SPDX-License-Identifier: GPL-3.0-or-later
"""Problems for dense steps that share no code with the linear-time one, and what a step leaves."""

import numpy as np
from scope.solver import Measurements, Options, Priors, Stage, State, Weights, make_tree, rotations
from scope.solver.gauss_newton.linearize import linearize, make_blocks, make_pose
from scope.solver.gauss_newton.recursion import make_workspace, retract, step
from scope.solver.gauss_newton.terms import make_terms
from scope.solver.measurements import Keypoints2D, Keypoints3D, OrientationField, PosePriors

from ..dense import jacobian, residuals, robust_factors
from ..synthetic import INTRINSICS, forward, project, random_body, random_state

ROOT_SCALE = 3.0


def problem(seed, K, P, M):
    """A random problem in which every residual takes part: what the solver gets, and what the dense
    step needs.
    """
    rng = np.random.default_rng(seed)
    body = random_body(rng, K, P, M)
    state = random_state(rng, K, P)
    R, t, points = forward(body, *state)
    directions = points - t[body.keypoint_part] + 0.02 * rng.standard_normal((M, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    data = {
        "pixels": project(points) + 5.0 * rng.standard_normal((M, 2)),
        "points": points + 0.05 * rng.standard_normal((M, 3)),
        "directions": directions,
        "joint_mean": rotations.exp(0.4 * rng.standard_normal((K, 3))),
        "joint_weights": rng.uniform(0.5, 2.0, K),
        "part": K // 2,
        "R_hat": R[K // 2] @ rotations.exp(0.3 * rng.standard_normal(3)),
        "t_hat": t[K // 2] + 0.1 * rng.standard_normal(3),
    }
    confidence = rng.uniform(0.3, 1.0, (3, M))
    index = np.arange(M)
    measurements = Measurements(
        INTRINSICS,
        Keypoints2D(index, data["pixels"], confidence[0]),
        Keypoints3D(index, data["points"], confidence[1]),
        OrientationField(M + body.keypoint_part, index, directions, confidence[2]),
        PosePriors([data["part"]], [data["R_hat"]], [data["t_hat"]], [70.0], [90.0]),
    )
    L = rng.standard_normal((P, P))
    priors = Priors(
        data["joint_mean"], data["joint_weights"], rng.standard_normal(P), L @ L.T + np.eye(P)
    )
    options = Options()
    weights = Weights(joint_limits=0.0)
    tree = make_tree(body)
    table, _, _ = options.stage_table([Stage(weights)])
    terms = make_terms(tree, measurements, priors)
    raw = residuals(body, data)
    sigmas = [
        options.robust_keypoints2d,
        options.robust_keypoints3d,
        options.robust_orientation_field,
    ] + [np.inf] * 3
    scales = [
        weights.keypoints2d * confidence[0],
        weights.keypoints3d * confidence[1],
        weights.orientation_field * confidence[2],
        weights.joint_prior * data["joint_weights"],
        np.array([70.0]),
        np.array([90.0]),
    ]
    return (
        rng,
        body,
        state,
        tree,
        terms,
        table[0],
        raw,
        sigmas,
        scales,
        priors,
        weights,
        measurements,
    )


def dense_system(body, state, raw, sigmas, scales, priors, weights):
    """J and r of everything, and the cost, from the definitions."""
    K = len(state[2])
    P = len(state[3])
    factors, cost = robust_factors(raw(state, np.zeros(6 + 3 * K + P)), sigmas, scales)

    def stacked(moved_state, d):
        blocks = [f[:, None] * r for f, r in zip(factors, raw(moved_state, d), strict=True)]
        root = (
            np.sqrt(weights.shape) * np.linalg.cholesky(priors.shape_information).T
            if P
            else np.zeros((0, 0))
        )
        return np.concatenate(
            [b.ravel() for b in blocks] + [root @ (moved_state[3] - priors.shape_mean)]
        )

    J = jacobian(body, state, stacked)
    r = np.real(stacked(state, np.zeros(6 + 3 * K + P)))
    shape = r[len(r) - P :]
    return J, r, cost + 0.5 * shape @ shape


def test_twists_of_parts_follow_from_a_step_that_leaves_the_blocks_as_they_are():
    _, body, state, tree, terms, stage, *_ = problem(5, 9, 4, 40)
    pose = State(*state).pose(tree)
    trial = make_pose(tree)
    blocks = make_blocks(tree)
    work = make_workspace(tree)
    linearize(tree, terms, stage, pose, blocks, work.scratch)
    first = step(tree, pose, blocks, 1.0, ROOT_SCALE, work)
    assert step(tree, pose, blocks, 500.0, ROOT_SCALE, work) < first
    assert step(tree, pose, blocks, 1.0, ROOT_SCALE, work) == first
    for array in (work.x, work.u, work.dbeta):
        array *= 1e-7
    retract(tree, pose, work, trial)
    R, t, _ = forward(body, trial.R[0], trial.t[0], trial.Omega[1:], trial.beta[:4])
    for i in range(10):
        w = work.x[i, :3]
        nu = work.x[i, 3:]
        np.testing.assert_allclose(rotations.log(R[i] @ pose.R[i].T), w, atol=1e-12)
        expected = np.cross(w, pose.t[i] - pose.t[0]) + nu + pose.D[i, :, :4] @ work.dbeta[:4]
        np.testing.assert_allclose(t[i] - pose.t[i], expected, atol=1e-12)
