# SPDX-License-Identifier: GPL-3.0-or-later
"""One shape and one focal length over a clip."""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    Keypoints2D,
    Keypoints3D,
    Measurements,
    Options,
    Priors,
    ScopeWarning,
    ShapeError,
    Stage,
    State,
    Status,
    Weights,
    carry,
    fit,
    fit_clip,
    load_body,
    rotations,
)

from .. import person
from ..synthetic import INTRINSICS, forward, project, random_body, random_state

K = 12
P = 6
M = 52
T = 12
WEAK = Options(stages=[Stage(Weights(joint_prior=1e-3, shape=1e-4, joint_limits=0.0), 1e-12, 300)])
SCALE = 1.12


def clip(seed, noise=0.0, scale=SCALE, frames=T):
    """A walk through random states seen by a camera whose focal length is `scale` times what the
    solver is told.
    """
    rng = np.random.default_rng(seed)
    body = random_body(rng, K, P, M)
    R0, t0, Omega, beta = random_state(rng, K, P, angle=0.3)
    true = INTRINSICS.copy()
    true[0, 0] *= scale
    true[1, 1] *= scale
    index = np.arange(M)
    ones = np.ones(M)
    states = []
    measurements = []
    for _ in range(frames):
        R0 = rotations.exp(0.1 * rng.standard_normal(3)) @ R0
        t0 = t0 + 0.03 * rng.standard_normal(3)
        Omega = Omega @ rotations.exp(0.06 * rng.standard_normal((K, 3)))
        states.append((R0, t0, Omega, beta))
        p = forward(body, *states[-1])[2]
        pixels = project(p, true) + 2.0 * noise * rng.standard_normal((M, 2))
        points = p + 0.01 * noise * rng.standard_normal((M, 3))
        measurements.append(
            Measurements(
                INTRINSICS, Keypoints2D(index, pixels, ones), Keypoints3D(index, points, ones)
            )
        )
    return body, states, measurements, beta


def refined(body, measurements, focal=True):
    """The clip fitted with the default weights, then with hardly any prior; the focal length's
    scale.
    """
    first = fit_clip(body, measurements, focal=focal, priors=Priors())
    known = INTRINSICS.copy()
    known[:2, :2] *= first.focal_scale
    again = [replace(m, intrinsics=known) for m in measurements]
    second = fit_clip(
        body,
        again,
        init=[f.state for f in first.frames],
        options=WEAK,
        priors=Priors(),
        focal=focal,
        focal_weight=1e-6,
    )
    return second, first.focal_scale * second.focal_scale


def test_recovers_shape_and_focal_length_without_noise():
    body, states, measurements, beta = clip(0)
    for some in (slice(None), slice(2, 11, 4)):
        found, scale = refined(body, measurements[some])
        np.testing.assert_allclose(found.beta, beta, atol=2e-4)
        assert scale == pytest.approx(SCALE, abs=2e-5)
        for f, state in zip(found.frames, states[some], strict=True):
            assert np.linalg.norm(f.t_camera_part - forward(body, *state)[1], axis=1).max() < 1e-3


def test_noise_leaves_errors_of_the_size_the_information_says():
    body, _, measurements, beta = clip(0, noise=1.0)
    found, scale = refined(body, measurements)
    error = found.beta - beta
    # noise variance times weight: (2 px / 1100)^2 1e6 = 3.3 and 0.01^2 24000 = 2.4; chi^2 of P
    # degrees of freedom
    assert error @ found.beta_information @ error / 3.3 < 22.0
    assert abs(scale - SCALE) < 0.02


def test_a_strong_prior_keeps_the_focal_length():
    body, _, measurements, _ = clip(0, frames=4)
    found = fit_clip(body, measurements, focal=True, focal_weight=1e9, priors=Priors())
    assert found.focal_scale == pytest.approx(1.0, abs=0.02)


def test_carried_information_equals_what_the_frames_say_together():
    """With the pose eliminated at the same states, information adds up; the causal estimate nears
    the joint one.
    """
    body, _, measurements, beta = clip(6, noise=1.0, scale=1.0)
    priors = Priors()
    last = None
    for m in measurements:
        fitted = fit(body, m, init=last, priors=priors)
        priors = carry(priors, fitted, Weights().shape)
        last = fitted.state
    joint = fit_clip(body, measurements, priors=Priors())
    single = fit(body, measurements[0], priors=Priors())
    causal_error = np.linalg.norm(fitted.state.beta - joint.beta)
    assert causal_error < 0.5 * np.linalg.norm(single.state.beta - joint.beta)
    ratio = np.diag(priors.shape_information) * Weights().shape / np.diag(joint.beta_information)
    assert (np.abs(ratio - 1) < 0.1).all()


def test_frames_share_the_shape_and_those_left_out_are_fitted_to_it():
    body, states, measurements, _ = clip(7, noise=0.5)
    every = fit_clip(body, measurements, focal=True)
    some = fit_clip(body, measurements, focal=True, shape_frames=4)
    for f, state in zip(some.frames, states, strict=True):
        np.testing.assert_array_equal(f.state.beta, some.beta)
        assert np.linalg.norm(f.t_camera_part - forward(body, *state)[1], axis=1).max() < 0.05
    assert some.focal_scale == pytest.approx(every.focal_scale, abs=0.01)


def test_a_clip_without_measurements_ends_well():
    body, *_ = clip(9, frames=1)
    with pytest.warns(ScopeWarning, match="Nothing that was measured is usable") as told:
        empty = fit_clip(body, [Measurements(), Measurements()], focal=True)
    assert told[0].filename == __file__
    assert empty.status is Status.NO_MEASUREMENTS
    assert empty.focal_scale == 1.0
    np.testing.assert_array_equal(empty.beta, np.zeros(P))


def from_behind():
    """The default body with its back to the camera, where a start from the rest pose ends a metre
    beside the truth.
    """
    body = load_body("scope")
    state = person.pose(body, seed=3, bend=0.1)
    turn = np.diag([1.0, -1.0, -1.0]) @ rotations.exp([0.0, np.pi - 0.3, 0.0])
    R, t = person.place(body, replace(state, R_camera_root=turn))
    index = np.array(list(body.keypoint_set("blazepose").values()))
    points = body.keypoints(R, t, state.beta)[index]
    ones = np.ones(len(index))
    image = Keypoints2D(index, person.project(points), ones)
    space = Keypoints3D(index, points, ones)
    return body, t, Measurements(person.INTRINSICS, image, space)


@pytest.mark.parametrize("unseen", [1, 3])
def test_whoever_appears_later_is_fitted_as_from_the_first_frame(unseen):
    body, joints, seen = from_behind()
    found = fit_clip(body, [*[Measurements()] * unseen, seen, seen, seen])
    before = found.frames[:unseen]
    after = found.frames[unseen:]
    for f in [*before, *after]:  # those before hold the pose in which the person appears
        assert np.linalg.norm(f.t_camera_part - joints, axis=1).mean() < 0.02
    assert {f.status for f in before} == {Status.NO_MEASUREMENTS}


def test_a_clip_without_a_frame_or_a_state_for_each_is_refused():
    body, _, measurements, _ = clip(10, frames=2)
    with pytest.raises(ShapeError, match="at least one frame"):
        fit_clip(body, [])
    with pytest.raises(ShapeError, match="one initial state per frame"):
        fit_clip(body, measurements, init=[State.rest(K, P)])


def test_a_report_changes_nothing_of_what_is_found():
    """The shape's information with a report was that of the shape prior alone."""
    body, _, measurements, _ = clip(13, noise=1.0, frames=3)
    for focal in (False, True):
        plain = fit_clip(body, measurements, focal=focal)
        told = fit_clip(body, measurements, focal=focal, options=Options(report=True))
        assert np.linalg.eigvalsh(plain.beta_information - Weights().shape * np.eye(P)).min() > 1.0
        np.testing.assert_array_equal(told.beta_information, plain.beta_information)
        for a, b in zip(told.frames, plain.frames, strict=True):
            np.testing.assert_array_equal(a.beta_information, b.beta_information)


def test_a_gap_has_the_pose_of_the_frame_before_at_its_final_depth():
    """With an unknown focal length, the depths of the first pass are those of the given one."""
    body, _, measurements, _ = clip(14, frames=7)
    gaps = {0: 1, 3: 2, 4: 2, 6: 5}  # the frame before the first measured one has that one's pose
    for k in gaps:
        measurements[k] = Measurements()
    found = fit_clip(body, measurements, focal=True, shape_frames=2)
    for k, of in gaps.items():
        assert found.frames[k].status is Status.NO_MEASUREMENTS
        expected = found.frames[of].t_camera_part
        np.testing.assert_allclose(found.frames[k].t_camera_part, expected, atol=1e-9)


@pytest.mark.parametrize("sigma_px", [None, 30.0])
def test_frames_beyond_those_that_decide_are_weighted_as_they_are(sigma_px):
    """Of a frame that occurs several times, each has the same pose, also with a focal length twice
    the given one and 2D and 3D keypoints that contradict each other.
    """
    body, _, (seen,), _ = clip(15, noise=3.0, scale=2.0, frames=1)
    image = replace(seen.keypoints2d, sigma_px=sigma_px, confidence=[0.5] * M)
    seen = replace(seen, keypoints2d=image)
    options = replace(WEAK, robust_keypoints2d=1e-3)
    found = fit_clip(body, [seen] * 3, focal=True, shape_frames=2, options=options, priors=Priors())
    assert found.focal_scale > 1.5
    first, left_out, _ = found.frames
    np.testing.assert_allclose(left_out.t_camera_part, first.t_camera_part, atol=1e-5)
