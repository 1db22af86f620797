# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting one frame: recovery, invariance, prediction, and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    InputError,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    Options,
    OrientationField,
    PosePriors,
    Priors,
    ShapeError,
    Stage,
    State,
    Status,
    Weights,
    fit,
    gauss_newton_step,
    rotations,
)
from scope.solver.residuals.registry import RESIDUALS

from ..synthetic import INTRINSICS, forward, project, random_body, random_state

K = 23
P = 10
M = 60
FREE = Weights(joint_prior=0.0, shape=0.0, joint_limits=0.0)
NO_PRIOR = Options(stages=[Stage(FREE, 1e-14, 200)])


def measured(body, state, noise=0.0, seed=0):
    """All three kinds of measurement of every keypoint; noise in units of 1 px, 5 mm, 0.01."""
    rng = np.random.default_rng(seed)
    R, t, p = forward(body, *state)
    n = len(p)
    index = np.arange(n)
    ones = np.ones(n)
    return Measurements(
        INTRINSICS,
        Keypoints2D(index, project(p) + noise * rng.standard_normal((n, 2)), ones),
        Keypoints3D(index, p + 0.005 * noise * rng.standard_normal((n, 3)), ones),
        OrientationField(
            n + body.keypoint_part,
            index,
            p - t[body.keypoint_part] + 0.002 * noise * rng.standard_normal((n, 3)),
            ones,
        ),
    )


def scene(seed, angle=0.4, keypoints=M):
    rng = np.random.default_rng(seed)
    body = random_body(rng, K, P, keypoints)
    return body, random_state(rng, K, P, angle)


@pytest.mark.parametrize("seed", range(2))
def test_recovers_pose_and_shape_without_noise(seed):
    body, state = scene(seed)
    m = measured(body, state)
    found = fit(body, m, init=fit(body, m).state, options=NO_PRIOR, priors=Priors())
    R, t, _ = forward(body, *state)
    np.testing.assert_allclose(found.t_camera_part, t, atol=1e-6)
    np.testing.assert_allclose(found.R_camera_part, R, atol=1e-5)
    np.testing.assert_allclose(found.state.beta, state[3], atol=1e-5)
    assert found.status in (Status.CONVERGED, Status.STALLED)


@pytest.mark.parametrize("seed", range(3))
def test_cold_start_finds_the_person_with_the_default_schedule(seed):
    body, state = scene(seed)
    found = fit(body, measured(body, state, noise=1.0, seed=seed))
    _, t, _ = forward(body, *state)
    assert found.status is Status.CONVERGED
    assert np.linalg.norm(found.t_camera_part - t, axis=1).max() < 0.03


@pytest.mark.parametrize("kind", ["keypoints2d", "keypoints3d", "orientation_field"])
def test_one_kind_of_measurement_is_enough_to_start(kind):
    body, (R0, t0, Omega, beta) = scene(1, angle=0.2)
    state = (np.diag([1.0, -1.0, -1.0]) @ rotations.exp([0.0, 0.4, 0.0]), t0, Omega, beta)
    m = measured(body, state)
    only = Measurements(INTRINSICS, **{kind: getattr(m, kind)})
    found = fit(body, only)
    assert found.status is Status.CONVERGED
    _, t, p = forward(
        body,
        found.state.R_camera_root,
        found.state.t_camera_root,
        found.state.Omega,
        found.state.beta,
    )
    _, t_true, p_true = forward(body, *state)
    if kind == "keypoints2d":
        assert np.median(np.linalg.norm(project(p) - project(p_true), axis=1)) < 10.0
    elif kind == "keypoints3d":
        assert np.linalg.norm(p - p_true, axis=1).max() < 0.03
    else:
        bone = p - t[body.keypoint_part]
        true = p_true - t_true[body.keypoint_part]
        cosines = (
            np.sum(bone * true, 1) / np.linalg.norm(bone, axis=1) / np.linalg.norm(true, axis=1)
        )
        assert np.median(cosines) > 0.98


def test_an_outlier_moves_the_fit_less_than_without_the_robust_kernel():
    body, state = scene(2)
    m = measured(body, state)
    bad = Keypoints3D(m.keypoints3d.indices, m.keypoints3d.points.copy(), m.keypoints3d.confidence)
    bad.points[10] += [0.0, 0.8, 0.0]
    m = replace(m, keypoints3d=bad)
    plain = Options(
        robust_keypoints2d=np.inf, robust_keypoints3d=np.inf, robust_orientation_field=np.inf
    )
    _, t, _ = forward(body, *state)
    error = [np.abs(fit(body, m, options=o).t_camera_part - t).max() for o in (Options(), plain)]
    assert error[0] < 0.3 * error[1]


def test_a_step_turns_with_camera_and_person():
    """However far away they are moved together, the step is the same in the new axes."""
    body, state = scene(3)
    m = replace(measured(body, state, noise=2.0), keypoints2d=None)
    start = State(*random_state(np.random.default_rng(9), K, P))
    G = rotations.exp([0.3, -1.0, 0.5])
    shift = np.array([2.0, -30.0, 400.0])
    field = m.orientation_field
    elsewhere = replace(
        m,
        keypoints3d=replace(m.keypoints3d, points=m.keypoints3d.points @ G.T + shift),
        orientation_field=replace(field, directions=field.directions @ G.T),
    )
    moved = replace(
        start, R_camera_root=G @ start.R_camera_root, t_camera_root=G @ start.t_camera_root + shift
    )
    a = gauss_newton_step(body, m, start, priors=Priors(), damping=30.0)
    b = gauss_newton_step(body, elsewhere, moved, priors=Priors(), damping=30.0)
    assert a.predicted_decrease == pytest.approx(b.predicted_decrease, rel=1e-8)
    turned = a.direction[:-P].reshape(-1, 3) @ G.T
    np.testing.assert_allclose(b.direction[:-P].reshape(-1, 3), turned, atol=1e-8)
    np.testing.assert_allclose(b.direction[-P:], a.direction[-P:], atol=1e-7)


def test_joint_limit_keeps_a_knee_from_bending_forwards():
    rng = np.random.default_rng(0)
    body = random_body(rng, 2, 0, 0)
    body.parents = np.array([-1, 0, 1])
    body.l = np.array([[0, 0, 0], [0, -0.4, 0], [0, -0.4, 0.0]])
    body.joint_names = ("pelvis", "left_knee", "left_ankle")
    up = np.diag([1.0, -1.0, -1.0])
    forwards = up @ rotations.exp([-0.8, 0, 0]) @ [0, -0.4, 0.0]
    origin = np.array([0, 0, 3.0])
    knee = origin + up @ [0, -0.4, 0]
    m = Measurements(
        keypoints3d=Keypoints3D(
            [0, 1, 2], np.stack([origin, knee, knee + forwards]), [1.0, 1.0, 1.0]
        ),
        pose_priors=PosePriors([0], up[None], origin[None], [1e6], [1e6]),
    )
    init = State(up, origin, np.tile(np.eye(3), (2, 1, 1)), np.zeros(0))
    loose = fit(body, m, init=init, priors=Priors())
    limited = fit(body, m, init=init, options=Options(stages=[Stage(Weights(joint_limits=1e6))]))
    angle = [rotations.log(f.state.Omega[0])[0] for f in (loose, limited)]
    assert angle[0] < -0.6
    assert -0.1 < angle[1] < 0.05


def test_nothing_measured_returns_the_initial_state():
    body, state = scene(9)
    found = fit(body, Measurements(), init=State(*state))
    np.testing.assert_allclose(found.state.Omega, state[2], atol=1e-12)
    assert found.measurements == 0


@pytest.mark.parametrize(
    ("measurements", "message"),
    [
        (
            Measurements(INTRINSICS, Keypoints2D([0, 1], [[0.0, 0.0]], [1.0, 1.0])),
            r"\(2, 2\), but got shape \(1, 2\)",
        ),
        (Measurements(None, Keypoints2D([0], [[0.0, 0.0]], [1.0])), "intrinsics"),
        (
            Measurements(keypoints3d=Keypoints3D([M + K + 1], [[0.0, 0.0, 1.0]], [1.0])),
            f"0..{M + K}",
        ),
        (Measurements(keypoints3d=Keypoints3D([0.5], [[0.0, 0.0, 1.0]], [1.0])), "integers"),
        (
            Measurements(orientation_field=OrientationField([0], [M - 1], [[0, 0, 1.0]], [1.0])),
            "no body part has in common",
        ),
        (
            Measurements(pose_priors=PosePriors([0], np.eye(3), np.zeros((1, 3)), [1.0], [1.0])),
            r"\(1, 3, 3\)",
        ),
    ],
)
def test_wrong_shapes_are_refused_with_what_was_expected(measurements, message):
    body, _ = scene(10)
    with pytest.raises(InputError, match=message):
        fit(body, measurements)


INDICES = {
    "joint_prior": ([0, K + 1], f"Joints of 'joint_prior' must lie in 1..{K}"),
    "joint_limits": ([0, K + 1], f"Joints of 'joint_limits' must lie in 1..{K}"),
    "joint_flow": ([-1, K + 1], f"Parts of 'joint_flow' must lie in 0..{K}"),
}


@pytest.mark.parametrize("name", INDICES)
def test_rows_of_tables_that_point_outside_the_body_are_refused(name):
    body, state = scene(10)
    module = RESIDUALS[name]
    (outside, message) = INDICES[name]
    for index in outside:
        table = np.full((1, module.INTS), index), np.ones((1, module.FLOATS))
        with pytest.raises(ShapeError, match=f"{message}, but go from {index} to {index}"):
            fit(body, replace(measured(body, state), tables={name: table}))
        if name in ("joint_limits", "joint_flow"):
            with pytest.raises(ShapeError, match=message):
                fit(
                    body,
                    measured(body, state),
                    priors=Priors(**{name.removeprefix("joint_"): table}),
                )


def test_a_mean_without_weight_may_be_anything():
    """Without a state, a fit starts from the means, from the rest pose where they weigh nothing."""
    body, state = scene(3)
    weights = np.ones(K)
    weights[::2] = 0.0
    mean = np.tile(np.eye(3), (K, 1, 1))
    expected = fit(body, measured(body, state), priors=Priors(mean, weights))
    mean[::2] = 7.0
    found = fit(body, measured(body, state), priors=Priors(mean, weights))
    np.testing.assert_array_equal(found.t_camera_part, expected.t_camera_part)
