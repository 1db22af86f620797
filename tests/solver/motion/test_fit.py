# SPDX-License-Identifier: GPL-3.0-or-later
"""`fit_motion` against known motions, and what its result must not depend on."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    InputError,
    InvalidValueError,
    Keypoints3D,
    Measurements,
    Options,
    Priors,
    ShapeError,
    Stage,
    State,
    Status,
    Weights,
    load_body,
    rotations,
)
from scope.solver.body_file import ASSETS
from scope.solver.gauss_newton.optimizer import MIN_DAMPING
from scope.solver.motion.fit import fit_motion
from scope.solver.motion.prior import MotionPrior, StandingPoints
from scope.solver.motion.views import View
from scope.solver.names import COCO

from ..synthetic import RandomBody, forward, random_body
from .clips import K, P, noisy_clip, walk

MARKERS = 28  # four on each part
TIGHT = Options(stages=[Stage(Weights(joint_prior=1e-2, joint_limits=0.0, shape=1.0), 1e-12, 60)])
SMOOTH = MotionPrior(robust_joints=np.inf, robust_root_rotation=np.inf, robust_root_position=np.inf)


def placed(body, s):
    """Rotations, joints and markers of a state, from the definition."""
    return forward(body, s.R_camera_root, s.t_camera_root, s.Omega, s.beta)


def joints(body, states):
    """The joints (T, K+1, 3) of states."""
    return np.array([placed(body, s)[1] for s in states])


def solved(body, frames, times, init=None, **given):
    """A motion whose priors hardly weigh anything."""
    given = {"priors": Priors(), "options": TIGHT} | given
    return fit_motion(body, frames, times, init=init, **given)


def smooth_walk(rng, frames, rate):
    """A body, its states in a smooth motion, and their times."""
    body, (first,), _ = walk(rng, 1, random_body(rng, K, P, MARKERS))
    times = np.arange(frames) / rate
    swing = 0.4 * rng.standard_normal((K, 3))
    turn = rng.uniform(1.0, 3.0, (K, 1))
    states = [
        State(
            rotations.exp([0.0, 0.4 * t, 0.1 * np.sin(t)]) @ first.R_camera_root,
            first.t_camera_root + [0.3 * np.sin(t), 0.05 * np.cos(3.0 * t), 0.1 * t],
            first.Omega @ rotations.exp(swing * np.sin(turn * t)), first.beta,
        )
        for t in times
    ]  # fmt: skip
    return body, states, times


def markers(body, states, rng, noise=0.01):
    """Measured points of every frame, in the world."""
    out = []
    for s in states:
        points = placed(body, s)[2]
        points = points + noise * rng.standard_normal(points.shape)
        out.append(Keypoints3D(np.arange(MARKERS), points))
    return out


def test_covariance_and_estimate_of_linear_motion_in_closed_form():
    """One point with no joints: the estimate is the linear smoother's, y -> A^-1 w y with A = w I +
    D'D w_a / h^3.
    """
    T = 24
    h = 1 / 30
    weight = Weights().keypoints3d
    w_a = 40.0
    rng = np.random.default_rng(0)
    empty = np.zeros((1, 3, 1))
    body = RandomBody(
        np.array([-1]), empty, np.zeros((1, 3)), np.array([0]), np.zeros((1, 3)), empty
    )
    truth = np.array([0.1, 0.2, 4.0]) + np.arange(T)[:, None] * h * np.array([1.0, -0.5, 0.3])
    y = truth + rng.standard_normal((T, 3)) / np.sqrt(weight)
    frames = [Measurements(keypoints3d=Keypoints3D([0], y[f : f + 1], [1.0])) for f in range(T)]
    init = [State(np.eye(3), p, np.zeros((0, 3, 3)), np.zeros(1)) for p in y]
    prior = replace(SMOOTH, root_position=w_a)
    exact = replace(TIGHT, robust_keypoints3d=np.inf)
    times = np.arange(T) * h
    found = solved(body, frames, times, init, options=exact, motion=prior, covariance=True)
    second = np.diff(np.eye(T), 2, axis=0)
    A = weight * np.eye(T) + w_a / h**3 * second.T @ second
    np.testing.assert_allclose(found.t_world_part[:, 0], np.linalg.solve(A, weight * y), atol=1e-8)
    expected = np.diag(np.linalg.inv(A))
    np.testing.assert_allclose(
        found.joint_covariance[:, 0], expected[:, None, None] * np.eye(3), rtol=1e-6, atol=1e-12
    )
    # an error of linear motion is as large as the covariance says, or smaller: the acceleration's
    # prior is right too
    chi = np.mean((found.t_world_part[:, 0] - truth) ** 2 / expected[:, None])
    assert 0.2 < chi < 1.5
    assert expected[T // 2] < 0.3 / weight


def test_errors_of_recorded_motion_are_as_large_as_stated():
    """Two thirds of a second at a time of the sample's recording, keypoints with 1 cm of noise: the
    errors of all joints over the stated deviations, with the default weights.
    """
    body = load_body("scope")
    with np.load(ASSETS / "sample" / "sample_truth.npz") as data:
        turns = rotations.exp(data["poses"].reshape(-1, 24, 3).astype(float))
        places = data["trans"].astype(float)
        beta = data["betas"].astype(float)
    points = [f"coco/{name}" for name in COCO[:17]]
    index = [body.point(name) for name in points]
    rng = np.random.default_rng(0)
    squares = []
    distances = []
    for first in (0, 50, 100):
        rows = slice(first, first + 20)
        poses = [
            body.forward_kinematics(R, t, beta)
            for R, t in zip(turns[rows], places[rows], strict=True)
        ]
        true = np.array([t for _, t in poses])
        seen = np.array([body.keypoints(R, t, beta, index) for R, t in poses])
        noisy = Keypoints3D(points, seen + 0.01 * rng.standard_normal(seen.shape), sigma_m=0.01)
        found = fit_motion(
            body, Measurements(keypoints3d=noisy), np.arange(20) / 30.0, covariance=True
        )
        off = found.t_world_part - true
        whitened = np.linalg.solve(found.joint_covariance, off[..., None])[..., 0]
        squares.append(np.sum(off * whitened, axis=-1) / 3.0)
        distances.append(np.linalg.norm(off, axis=-1))
    assert 0.8 < np.sqrt(np.mean(squares)) < 1.2
    assert np.mean(distances) < 0.013


def test_reversed_in_time_the_motion_is_the_same():
    rng = np.random.default_rng(1)
    body, states, times = smooth_walk(rng, 20, 30.0)
    frames = [Measurements(keypoints3d=m) for m in markers(body, states, rng)]
    stands = rng.uniform(0.0, 1.0, (20, 1))
    forwards = solved(body, frames, times, states, stands=StandingPoints([2], stands))
    reversed_stands = StandingPoints([2], stands[::-1])
    backwards = solved(body, frames[::-1], -times[::-1], states[::-1], stands=reversed_stands)
    np.testing.assert_allclose(backwards.t_world_part[::-1], forwards.t_world_part, atol=1e-6)
    np.testing.assert_allclose(backwards.beta, forwards.beta, atol=1e-5)
    assert forwards.status is Status.CONVERGED


@pytest.mark.parametrize("known", [True, False])
def test_windows_agree_with_the_whole_clip(known):
    rng = np.random.default_rng(2)
    body, states, times = smooth_walk(rng, 120, 15.0)
    frames = [Measurements(keypoints3d=m) for m in markers(body, states, rng)]
    shape = states[0].beta if known else None
    whole = solved(body, frames, times, states, shape=shape)
    cut = solved(body, frames, times, states, shape=shape, window=3.0, overlap=1.0)
    difference = np.linalg.norm(cut.t_world_part - whole.t_world_part, axis=-1)
    assert difference.max() < 1e-4
    assert 0.0 < difference.max()  # they were cut
    assert np.linalg.norm(whole.t_world_part - joints(body, states), axis=-1).mean() < 0.01


def test_moved_with_its_cameras_the_motion_moves_along():
    clip = noisy_clip(5, frames=5)
    G = rotations.exp(np.array([0.4, -0.8, 0.3]))
    g = np.array([1.0, -2.0, 0.5])
    frames = []
    elsewhere = []
    # without 3D keypoints, which are in the first camera's axes
    for first, *others in clip.frames():
        views = [
            replace(first, measurements=replace(first.measurements, keypoints3d=None)),
            *others,
        ]
        frames.append(views)
        elsewhere.append(
            [
                View(
                    v.measurements,
                    v.R_camera_world @ G.T,
                    v.t_camera_world - v.R_camera_world @ G.T @ g,
                )
                for v in views
            ]
        )
    starts = [
        State(G @ s.R_camera_root, G @ s.t_camera_root + g, s.Omega, s.beta) for s in clip.starts
    ]
    still = solved(clip.body, frames, clip.times, clip.starts)
    turned = solved(clip.body, elsewhere, clip.times, starts)
    np.testing.assert_allclose(turned.t_world_part, still.t_world_part @ G.T + g, atol=1e-6)


def test_markers_come_and_go():
    rng = np.random.default_rng(6)
    body, states, times = smooth_walk(rng, 40, 30.0)
    measured = markers(body, states, rng, noise=0.001)
    frames = [Measurements(keypoints3d=m) for m in measured]
    for f in range(15, 21):
        frames[f] = Measurements() if f < 18 else []
    for f in range(40):
        if f % 3 and frames[f] and f not in range(15, 21):
            keep = rng.permutation(MARKERS)[: MARKERS // 2]
            frames[f] = Measurements(keypoints3d=Keypoints3D(keep, measured[f].points[keep]))
    found = solved(body, frames, times)
    error = np.linalg.norm(found.t_world_part - joints(body, states), axis=-1)
    assert error[:15].max() < 0.02
    assert error[15:21, 0].max() < 0.02
    assert list(found.measurements[14:22]) == [
        len(frames[14].keypoints3d.indices),
        *[0] * 6,
        MARKERS,
    ]


def test_several_cameras_without_a_state_to_start_from():
    clip = noisy_clip(7, frames=4)
    frames = clip.frames()
    for views in frames:
        views[0] = replace(views[0], measurements=replace(views[0].measurements, keypoints3d=None))
    loose = MotionPrior(joints=0.01, root_rotation=0.01, root_position=0.1)  # the walk is jerky
    found = solved(clip.body, frames, clip.times, motion=loose)
    error = np.linalg.norm(found.t_world_part - joints(clip.body, clip.starts), axis=-1)
    assert np.median(error) < 0.03


def test_a_standing_point_stands():
    rng = np.random.default_rng(8)
    body, states, times = smooth_walk(rng, 20, 30.0)
    frames = [Measurements(keypoints3d=m) for m in markers(body, states, rng, noise=0.003)]
    held = StandingPoints([3], np.ones((20, 1)))
    found = solved(body, frames, times, states, stands=held, motion=MotionPrior(contact=1e7))
    loose = solved(body, frames, times, states)
    steps = []
    for each in (found, loose):
        point = np.array([placed(body, s)[2][3] for s in each.states])
        steps.append(np.linalg.norm(np.diff(point, axis=0), axis=1).max())
    assert steps[0] < 1e-3
    assert steps[1] > 5e-3


def test_what_cannot_be_used_is_refused():
    body, states, times = walk(np.random.default_rng(0), 3)
    frames = [Measurements()] * 3
    with pytest.raises(InvalidValueError, match="increase from frame to frame"):
        fit_motion(body, frames, times[::-1])
    with pytest.raises(ShapeError, match="at least one frame"):
        fit_motion(body, [], [])
    with pytest.raises(ShapeError, match="one initial state per frame"):
        fit_motion(body, frames, times, init=states[:2])
    with pytest.raises(InvalidValueError, match="overlap of windows"):
        fit_motion(body, frames, times, overlap=12.0)
    with pytest.raises(
        InvalidValueError, match="window must be a positive number of seconds.* but is 0"
    ):
        fit_motion(body, frames, times, window=0.0)
    with pytest.raises(InvalidValueError, match="leave `shape` out"):
        fit_motion(body, frames, times, shape=np.zeros(P), focal=True)
    with pytest.raises(InvalidValueError, match="Probability of standing"):
        fit_motion(body, frames, times, stands=StandingPoints([0], [[1.0], [np.nan], [1.0]]))
    assert fit_motion(body, frames, times, init=states).status is Status.NO_MEASUREMENTS


TURNED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
FRAMES_REFUSED = {
    "a view": (
        View(Measurements()),
        "frames[1] must be Measurements or a list of View, but is a View",
    ),
    "measurements among views": (
        [Measurements()],
        "frames[1][0] must be View, but is a Measurements",
    ),
    "scaled": (
        [View(Measurements()), View(Measurements(), 2.0 * TURNED)],
        "R_camera_world of frames[1][1] must be",
    ),
    "far": (
        [View(Measurements(), TURNED, [0.0, np.inf, 0.0])],
        "t_camera_world of frames[1][0] must be finite",
    ),
}


@pytest.mark.parametrize(("frame", "message"), FRAMES_REFUSED.values(), ids=FRAMES_REFUSED)
def test_without_states_a_frame_that_cannot_be_used_is_told_too(frame, message):
    body, _, times = walk(np.random.default_rng(0), 3)
    with pytest.raises(InputError, match=re.escape(message)):
        fit_motion(body, [Measurements(), frame, Measurements()], times)


@pytest.mark.parametrize("window", [10.0, 0.2])
def test_a_state_of_no_number_gives_a_status_and_no_covariances(window):
    rng = np.random.default_rng(9)
    body, states, times = smooth_walk(rng, 20, 30.0)
    frames = [Measurements(keypoints3d=points) for points in markers(body, states, rng)]
    states[1] = replace(states[1], t_camera_root=np.full(3, np.nan))
    found = solved(body, frames, times, states, covariance=True, window=window, overlap=0.0)
    assert found.status is Status.NON_FINITE
    assert np.isnan(found.joint_covariance[1]).all()
    assert np.isnan(found.covariance_from_root[1]).all()
    if window < times[-1] - times[0]:
        assert np.isfinite(found.joint_covariance[-1]).all()
        assert np.isfinite(found.beta).all()


def test_what_nothing_fixes_is_not_taken_for_known_beside_what_is_known_well():
    """A part turns freely about a point that is known to a tenth of a millimetre. The damping that
    stands for it is lost in rounding, and its child seemed to be where it is without any error.
    """
    lever = np.array([0.2, 0.1, 0.3])
    child = np.array([0.1, -0.2, 0.0])
    levers = np.concatenate([0.3 * np.eye(3), [lever]])
    parents = np.array([-1, 0, 1])
    offsets = np.array([np.zeros(3), [0.4, 0.0, 0.0], child])
    part = np.array([0, 0, 0, 1])
    body = RandomBody(parents, np.zeros((3, 3, 0)), offsets, part, levers, np.zeros((4, 3, 0)))
    state = State.rest(2, 0)
    seen = Measurements(keypoints3d=Keypoints3D(np.arange(4), placed(body, state)[2], sigma_m=1e-4))
    free = Priors(joint_weights=np.zeros(2))
    found = fit_motion(body, [seen], [0.5], init=[state], priors=free, covariance=True)
    known = found.joint_covariance[0, 1]
    assert np.trace(known) < 1e-6
    axis = lever / np.linalg.norm(lever)
    across = state.R_camera_root @ np.cross(axis, child)
    covariance = found.joint_covariance[0, 2]
    variance = np.trace(covariance)
    assert variance > 0.999 * (across @ across) / MIN_DAMPING
    np.testing.assert_allclose(
        covariance, variance * np.outer(across, across) / (across @ across), atol=1e-6 * variance
    )
