# SPDX-License-Identifier: GPL-3.0-or-later
"""Derivatives of a solution against differences of fits, and against a mean, whose are known."""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    InvalidValueError,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    Options,
    Priors,
    ShapeError,
    Stage,
    State,
    Weights,
    fit,
    solution_derivatives,
    solution_gradient,
)

from ..small_problem import BODY, K, M, P
from ..synthetic import INTRINSICS, forward, project, random_state

TRUTH = State(*random_state(np.random.default_rng(5), K, P))
POINTS = forward(BODY, TRUTH.R_camera_root, TRUTH.t_camera_root, TRUTH.Omega, TRUTH.beta)[2]
NOISE = np.random.default_rng(6).standard_normal((M, 3))
INDEX = np.arange(M)
PIXELS = Keypoints2D(INDEX, project(POINTS) + 2.0 * NOISE[:, :2], np.full(M, 0.9), sigma_px=2.0)
SEEN = Measurements(
    INTRINSICS,
    PIXELS,
    Keypoints3D(INDEX, POINTS + 0.02 * NOISE, np.full(M, 0.8), sigma_m=0.02),
)
PRIORS = Priors()


def options(**weights):
    return Options(stages=[Stage(Weights(joint_limits=0.0, **weights), 0.0, 300)])


def solved(seen, start, chosen):
    return fit(BODY, seen, init=start, priors=PRIORS, options=chosen)


@pytest.fixture(scope="module")
def solution():
    return solved(SEEN, TRUTH, options()).state


def with_array(kind, of, k, step):
    """The measurements with one number of an array changed."""
    given = getattr(SEEN, kind)
    values = np.array(getattr(given, of), dtype=float)
    values[k] += step
    return replace(SEEN, **{kind: replace(given, **{of: values})})


CHANGES = {
    "keypoints3d.points": ((4, 1), 1e-3, lambda h: with_array("keypoints3d", "points", (4, 1), h)),
    "keypoints2d.pixels": ((7, 0), 0.1, lambda h: with_array("keypoints2d", "pixels", (7, 0), h)),
    "keypoints3d.confidence": (
        (3,),
        0.02,
        lambda h: with_array("keypoints3d", "confidence", (3,), h),
    ),
    "keypoints2d.sigma_px": (
        (),
        0.02,
        lambda h: replace(SEEN, keypoints2d=replace(PIXELS, sigma_px=2.0 + h)),
    ),
    "weights.keypoints2d": ((), 0.02 * Weights().keypoints2d, None),
    "weights.shape": ((), 0.02, None),
    "weights.joint_prior": ((), 0.08, None),
}


@pytest.mark.parametrize("name", CHANGES)
def test_they_are_those_of_fits_to_changed_measurements_and_weights(solution, name):
    at, step, change = CHANGES[name]
    found = solution_derivatives(BODY, SEEN, solution, [name], priors=PRIORS, options=options())
    _, _, weight = name.partition("weights.")
    fits = []
    for h in (step, -step):
        if weight:
            chosen = options(**{weight: getattr(Weights(), weight) + h})
            fits.append(solved(SEEN, solution, chosen).t_camera_part)
        else:
            fits.append(solved(change(h), solution, options()).t_camera_part)
    expected = (fits[0] - fits[1]) / (2.0 * step)
    joints = found.joints[name]
    assert joints.shape == (K + 1, 3, *np.shape(joints[0, 0]))
    np.testing.assert_allclose(
        joints[(..., *at)], expected, rtol=0, atol=2e-3 * np.abs(expected).max()
    )
    assert found.unknowns[name].shape[0] == 6 + 3 * K + P


NAMES = ["keypoints3d.points", "keypoints2d.pixels", "keypoints2d.sigma_px", "weights.shape"]


def test_a_gradient_is_the_product_of_a_loss_with_the_derivatives(solution):
    """Of joints and of unknowns, without any matrix of the unknowns."""
    found = solution_derivatives(BODY, SEEN, solution, NAMES, priors=PRIORS, options=options())
    rng = np.random.default_rng(7)
    by_joints = rng.standard_normal((K + 1, 3))
    by_unknowns = rng.standard_normal(6 + 3 * K + P)
    for loss, matrices, axes in (
        (by_joints, found.joints, 2),
        (by_unknowns, found.unknowns, 1),
    ):
        gradient = solution_gradient(
            BODY, SEEN, solution, loss, NAMES, priors=PRIORS, options=options()
        )
        for name, matrix in matrices.items():
            expected = np.tensordot(loss, matrix, axes)
            assert np.shape(gradient[name]) == np.shape(expected)
            error = np.abs(gradient[name] - expected).max()
            assert error < 1e-5 * np.abs(expected).max(), name


class Point:
    """A body of one part without shape, which three points on it fix."""

    parents = np.array([-1])
    S = np.zeros((1, 3, 0))
    l = np.zeros((1, 3))
    keypoint_part = np.zeros(4, np.int64)
    v_bar = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    V = np.zeros((4, 3, 0))


def test_the_place_of_a_rigid_part_is_the_mean_of_its_points():
    place = np.array([0.2, 0.1, 4.0])
    seen = Measurements(keypoints3d=Keypoints3D(np.arange(4), Point.v_bar + place))
    exact = Options(stages=[Stage(tolerance=0.0)], robust_keypoints3d=np.inf)
    state = State(np.eye(3), place, np.zeros((0, 3, 3)), np.zeros(0))
    found = solution_derivatives(
        Point(), seen, state, ["keypoints3d.points"], priors=PRIORS, options=exact
    )
    expected = np.broadcast_to(np.eye(3)[:, None, :] / 4.0, (3, 4, 3))
    np.testing.assert_allclose(found.joints["keypoints3d.points"][0], expected, atol=1e-7)


def test_what_has_no_derivative_is_named(solution):
    for name in ("orientation_field.directions", "keypoints3d.indices", "points", "floor.offset"):
        with pytest.raises(InvalidValueError, match=f"no derivative with respect to '{name}'"):
            solution_derivatives(BODY, SEEN, solution, [name], priors=PRIORS)
    with pytest.raises(InvalidValueError, match="no residual named 'nothing'"):
        solution_derivatives(BODY, SEEN, solution, ["weights.nothing"], priors=PRIORS)
    alone = Measurements(keypoints3d=Keypoints3D([0], POINTS[:1]))
    with pytest.raises(InvalidValueError, match="need a minimum"):
        solution_derivatives(BODY, alone, solution, ["keypoints3d.points"], priors=PRIORS)
    everywhere = np.ones(6 + 3 * K + P)
    free = Priors(joint_weights=np.zeros(K))
    with pytest.raises(InvalidValueError, match="need a minimum"):
        solution_gradient(BODY, alone, solution, everywhere, ["keypoints3d.points"], priors=free)
    with pytest.raises(ShapeError, match="loss"):
        solution_gradient(BODY, SEEN, solution, np.ones((2, 3)), NAMES, priors=PRIORS)
    assert not solution_gradient(
        BODY, SEEN, solution, np.zeros((K + 1, 3)), NAMES[:1], priors=PRIORS
    )[NAMES[0]].any()


@pytest.mark.parametrize(
    "of_the_fit",
    [
        {"options": options(shape=100.0)},
        {"priors": Priors(joint_weights=np.full(K, 100.0))},
        {"measurements": replace(SEEN, keypoints2d=None)},
    ],
)
def test_a_state_that_other_measurements_priors_or_weights_led_to_is_refused(of_the_fit):
    given = {"measurements": SEEN, "priors": PRIORS, "options": options()}
    state = fit(BODY, init=TRUTH, **given | of_the_fit).state
    for wrt in ([], ["keypoints3d.points"]):
        with pytest.raises(InvalidValueError, match="fit the same measurements with these priors"):
            solution_gradient(BODY, state=state, loss=np.ones((K + 1, 3)), wrt=wrt, **given)


def test_what_is_masked_has_no_influence():
    """As if its point were left out; the numbers below the mask were taken for measured ones."""
    points = np.ma.array(SEEN.keypoints3d.points)
    points[3] = np.ma.masked
    seen = replace(SEEN, keypoints3d=replace(SEEN.keypoints3d, points=points))
    others = np.delete(INDEX, 3)
    left_out = Keypoints3D(
        others, POINTS[others] + 0.02 * NOISE[others], np.full(M - 1, 0.8), sigma_m=0.02
    )
    state = solved(seen, TRUTH, options()).state
    wrt = ["keypoints3d.points"]
    found = solution_derivatives(BODY, seen, state, wrt, priors=PRIORS, options=options())
    expected = solution_derivatives(
        BODY, replace(SEEN, keypoints3d=left_out), state, wrt, priors=PRIORS, options=options()
    )
    joints = found.joints[wrt[0]]
    assert not joints[:, :, 3].any()
    scale = np.abs(joints).max()
    np.testing.assert_allclose(
        joints[:, :, others], expected.joints[wrt[0]], rtol=0, atol=1e-6 * scale
    )
