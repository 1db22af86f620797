# SPDX-License-Identifier: GPL-3.0-or-later
"""What no fit can use is refused in one sentence that names the field; what only looks odd is
not.
"""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scope.solver import (
    Floor,
    FootContacts,
    InputError,
    InvalidValueError,
    JointPrior,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    Options,
    PosePriors,
    Priors,
    ScopeWarning,
    ShapeError,
    Stage,
    State,
    UnitsWarning,
    Weights,
    fit,
    fit_batch,
    fit_clip,
    fit_motion,
    load_body,
    load_joint_prior,
    make_tree,
    rotations,
)

from .small_problem import BODY, KEYPOINTS, POINTS, SEEN, K, M, P
from .synthetic import INTRINSICS, project

UPRIGHT = np.eye(3)
SHORT = Options(stages=[Stage(max_iterations=2)])
NAN = np.nan
INF = np.inf


def untyped(value: object) -> Any:
    """Return the value as it is, for calls that a type checker would refuse before the solver
    can.
    """
    return value


def body(**fields):
    return replace(BODY, **fields)


def state(**fields):
    return replace(State.rest(K, P), **fields)


def seen(**fields):
    """Fit a frame of 3D keypoints and what is given."""
    return lambda: fit(BODY, replace(SEEN, **fields), options=SHORT)


def seen_2d(intrinsics, pixels=((100.0, 100.0),), confidence=(1.0,)):
    return seen(intrinsics=intrinsics, keypoints2d=Keypoints2D([0], pixels, confidence))


def started(start):
    """Every way in that an initial state has."""
    return [
        lambda: fit(BODY, SEEN, init=start, options=SHORT),
        lambda: fit_clip(BODY, [SEEN], init=[start], options=SHORT),
        lambda: fit_batch(BODY, [SEEN], init=[start], options=SHORT),
        lambda: start.pose(make_tree(BODY)),
    ]


def known(**fields):
    """Fit with priors."""
    return lambda: fit(BODY, SEEN, priors=Priors(**fields), options=SHORT)


def pose_prior(R=UPRIGHT, w_R=1.0, w_t=1.0):
    return PosePriors([0], R[None], np.array([[0.0, 0.0, 4.0]]), [w_R], [w_t])


def moved(matrix):
    """A matrix with its last row (0, 0, 1) changed, or another fault."""
    return INTRINSICS + np.array(matrix)


MIRROR = np.diag([1.0, 1.0, -1.0])
INDEFINITE = np.diag([1.0, -1.0, 1.0])
UP = np.array([0.0, -1.0, 0.0])

INTRINSICS_REFUSED = {
    "transposed": (INTRINSICS.T, "Intrinsics must be a camera matrix .* transpose it"),
    "scaled": (
        2.0 * INTRINSICS,
        "Intrinsics must be a camera matrix .* divide it by its last entry, 2",
    ),
    "last row": (moved([[0, 0, 0], [0, 0, 0], [0, 0.1, 0]]), "Intrinsics must be a camera matrix"),
    "turned": (moved([[0, 0, 0], [300, 0, 0], [0, 0, 0]]), "Intrinsics must be a camera matrix"),
    "behind": (np.diag([-1000.0, 1000.0, 1.0]), "positive focal lengths"),
    "NaN": (moved([[0, 0, NAN], [0, 0, 0], [0, 0, 0]]), "Intrinsics must be finite"),
    "3 by 4": (np.eye(3, 4), r"Intrinsics must have shape \(3, 3\), but got shape \(3, 4\)"),
}


@pytest.mark.parametrize(
    ("intrinsics", "message"), INTRINSICS_REFUSED.values(), ids=INTRINSICS_REFUSED
)
def test_intrinsics_that_are_no_camera_matrix_are_refused(intrinsics, message):
    with pytest.raises(InputError, match=message):
        seen_2d(intrinsics)()


STATES_REFUSED = {
    "a joint too few": (
        {"Omega": np.tile(np.eye(3), (K - 1, 1, 1))},
        ShapeError,
        r"Omega must have shape \(4, 3, 3\), but got shape \(3, 3, 3\)",
    ),
    "root mirrored": (
        {"R_camera_root": MIRROR},
        InvalidValueError,
        "R_camera_root of the initial state",
    ),
    "root NaN": (
        {"R_camera_root": np.full((3, 3), NAN)},
        InvalidValueError,
        "R_camera_root of the initial state",
    ),
    "joint scaled": (
        {"Omega": np.stack([np.eye(3), np.eye(3), 3.0 * np.eye(3), np.eye(3)])},
        InvalidValueError,
        "Omega of the initial state must be rotation matrices, .* but number 2 is",
    ),
}


@pytest.mark.parametrize("way", range(4), ids=["fit", "fit_clip", "fit_batch", "State.pose"])
@pytest.mark.parametrize(
    ("fields", "error", "message"), STATES_REFUSED.values(), ids=STATES_REFUSED
)
def test_initial_states_that_are_no_pose_are_refused(fields, error, message, way):
    with pytest.raises(error, match=message):
        started(state(**fields))[way]()


MEASURED_REFUSED = {
    "pose prior scaled": (
        seen(pose_priors=pose_prior(2.0 * np.eye(3))),
        "Rotations of pose priors must be rotation",
    ),
    "pose prior w_R": (
        seen(pose_priors=pose_prior(w_R=-1.0)),
        "Rotation weights of pose priors .* number 0 is -1",
    ),
    "contact": (
        seen(foot_contacts=FootContacts([0, 1], np.zeros((2, 3)), [1.0, -0.5])),
        "Probability of foot contacts must not be negative, but number 1 is -0.5",
    ),
    "floor's normal": (seen(floor=Floor([0], 2.0 * UP, 1.0, [1.0])), "normal of length 2"),
    "a table's indices": (
        seen(tables={"joint_limits": ([[0.7]], np.ones((1, 6)))}),
        r"Whole numbers of 'joint_limits' must be integers.* of shape \(n, 1\), but got float64",
    ),
    "a table's names": (
        seen(tables={"joint_limits": ([["left_hand"]], np.ones((1, 6)))}),
        r"integers, as of body.point\(name\) or body.joint_names.index\(name\), of shape",
    ),
    "confidence beside pixels": (
        seen(
            intrinsics=INTRINSICS,
            keypoints2d=Keypoints2D(range(M), np.column_stack([project(POINTS), np.ones(M)])),
        ),
        r"Pixels .* without confidence, must have shape \(12, 2\), but got shape \(12, 3\)",
    ),
    "confidence beside points": (
        seen(keypoints3d=Keypoints3D(range(M), np.column_stack([POINTS, np.ones(M)]))),
        r"Points .* without confidence, must have shape \(12, 3\), but got shape \(12, 4\)",
    ),
    "a table's numbers": (
        seen(tables={"joint_limits": ([[1]], [["a"] * 6])}),
        "Numbers of 'joint_limits' must be numbers",
    ),
    "a table of a field": (
        lambda: Measurements(tables={"floor": untyped(([[0]], np.ones((1, 6))))}),
        "tables must not hold 'floor', which has a field of its own; give it as Measurements.floor",
    ),
    "frames for the shape": (
        lambda: fit_clip(BODY, [SEEN], shape_frames=0),
        "shape_frames must be a whole number of at least 1, but is 0",
    ),
    "focal weight": (
        lambda: fit_clip(BODY, [SEEN], focal=True, focal_weight=-1.0),
        "focal_weight must be finite and not negative, but is -1",
    ),
    "masked indices": (
        seen(keypoints3d=Keypoints3D(np.ma.masked_equal(np.arange(M), 0), POINTS, np.ones(M))),
        "Indices of 3D keypoints must not be masked, but some are; leave these rows out",
    ),
    "threads": (
        lambda: fit_batch(BODY, [SEEN], threads=-2),
        "threads must be a whole number of at least 0, but is -2",
    ),
}


@pytest.mark.parametrize(("make", "message"), MEASURED_REFUSED.values(), ids=MEASURED_REFUSED)
def test_measurements_that_cannot_be_used_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_what_a_masked_array_masks_is_not_measured():
    wrong = POINTS + [[0.5, 0.5, 0.5]] * (np.arange(M) == 1)[:, None]
    masked = np.ma.masked_array(wrong, np.repeat(np.arange(M) == 1, 3))
    kept = np.arange(M) != 1
    without = Keypoints3D(np.arange(M)[kept], POINTS[kept], np.ones(M - 1))
    found = fit(BODY, Measurements(keypoints3d=Keypoints3D(np.arange(M), masked, np.ones(M))))
    expected = fit(BODY, Measurements(keypoints3d=without))
    assert found.measurements == expected.measurements == M - 1
    np.testing.assert_allclose(found.t_camera_part, expected.t_camera_part, atol=1e-9)


SETTINGS_REFUSED = {
    "indefinite": (
        known(shape_information=INDEFINITE),
        "Priors.shape_information.* has the eigenvalue -1",
    ),
    "not symmetric": (
        known(shape_information=np.eye(P) + 0.1 * np.eye(P, k=1)),
        "must be symmetric",
    ),
    "NaN": (
        known(shape_information=np.full((P, P), NAN)),
        "Information of the shape prior must be finite",
    ),
    "joint weight": (
        known(joint_weights=[1.0, 1.0, -1.0, 1.0]),
        "Weights of the joint prior .* number 2 is -1",
    ),
    "joint mean": (
        known(joint_mean=np.tile(2.0 * np.eye(3), (K, 1, 1))),
        "Means of the joint prior must be rotation",
    ),
    "weight": (
        lambda: Weights(keypoints3d=-1.0),
        "Weights.keypoints3d must be finite and not negative, but is -1",
    ),
    "tolerance": (
        lambda: Stage(tolerance=-1e-6),
        "Stage.tolerance must be a number of at least 0, but is -1e-06",
    ),
    "iterations": (
        lambda: Stage(max_iterations=-1),
        "Stage.max_iterations must be a whole number of at least 0",
    ),
    "robust": (
        lambda: Options(robust_keypoints2d=0.0),
        "Options.robust_keypoints2d must be positive",
    ),
    "damping": (lambda: Options(damping=NAN), "damping must be positive and finite, but is nan"),
    "root length": (lambda: Options(root_length=INF), "root_length must be positive and finite"),
    "a joint of the prior": (
        lambda: load_joint_prior().of("tail"),
        "no joint 'tail'; it has .*left_knee",
    ),
    "its weights": (
        lambda: load_joint_prior().tables(["pelvis", "neck"], {"neck": -1.0}),
        "weight of 'neck' must be finite and not negative",
    ),
    "its parameters": (
        lambda: JointPrior(("neck",), np.zeros((2, 5))),
        r"must have shape \(1, 243\), .* \(2, 5\)",
    ),
}


@pytest.mark.parametrize(("make", "message"), SETTINGS_REFUSED.values(), ids=SETTINGS_REFUSED)
def test_settings_that_cannot_be_used_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


SPOILED_S = BODY.S.copy()
SPOILED_S[2, 1, 0] = NAN
BODIES_REFUSED = {
    "parents after their children": (
        body(parents=np.array([-1, 2, 1, 2, 3])),
        ShapeError,
        "before their children",
    ),
    "S NaN": (body(S=SPOILED_S), InvalidValueError, "The body's S must be finite"),
    "V NaN": (body(V=np.full((M, 3, P), NAN)), InvalidValueError, "The body's V must be finite"),
    "V of another P": (
        body(V=np.zeros((M, 3, P + 1))),
        ShapeError,
        r"V must have shape \(12, 3, 3\)",
    ),
}


@pytest.mark.parametrize(("given", "error", "message"), BODIES_REFUSED.values(), ids=BODIES_REFUSED)
def test_bodies_that_cannot_be_used_are_refused(given, error, message):
    with pytest.raises(error, match=message):
        fit(given, SEEN, priors=Priors(), options=SHORT)


@pytest.mark.parametrize(
    "matrix",
    [
        np.zeros((3, 3)),
        MIRROR,
        1.1 * np.eye(3),
        np.diag([1.0, 1.2, 1.2]),
        np.eye(3) + 0.1 * np.eye(3, k=1),
        np.eye(3) + 0.1 * np.eye(3, k=-1),
        np.eye(3) + 0.1 * np.eye(3, k=-2),
    ],
)
def test_a_body_is_not_posed_by_matrices_that_are_no_rotations(matrix):
    person = load_body()
    turns = rotations.exp(np.random.default_rng(0).standard_normal((5, person.K + 1, 3))).round(2)
    turns[3] = NAN  # a frame that is not known
    person.forward_kinematics(turns, np.zeros(3))
    turns[1, 7] = matrix @ turns[1, 7]
    with pytest.raises(InvalidValueError, match="rotations must be .* but number 1, 7 is"):
        person.forward_kinematics(turns, np.zeros(3))


@pytest.mark.parametrize(
    "times",
    [np.arange(5), np.arange(5) * 1000.0 / 30.0],
)
def test_frame_numbers_or_milliseconds_for_seconds_bring_a_warning_and_a_motion(times):
    with pytest.warns(
        UnitsWarning,
        match="times are (whole numbers|far apart), .* divide frame numbers by the frame rate",
    ):
        assert len(fit_motion(BODY, [SEEN] * 5, times, priors=Priors(), options=SHORT).states) == 5


def test_lengths_in_millimetres_bring_a_warning_and_a_fit():
    m = replace(SEEN, keypoints3d=replace(SEEN.keypoints3d, points=1000.0 * POINTS))
    with pytest.warns(UnitsWarning, match="Points of 3D keypoints .* millimetres by 1000"):
        fit(BODY, m, options=SHORT)
    with pytest.warns(UnitsWarning, match="joint offsets l"):
        make_tree(body(l=1000.0 * BODY.l))


def seen_3d(points=POINTS, indices=np.arange(M), **more):  # noqa: B008
    return seen(keypoints3d=Keypoints3D(indices, points, **more))


TWICE = np.array([1, *range(1, M)])
PROBABLE_MISTAKES = {
    "metres as a confidence": (seen_3d(confidence=0.02), "give it as sigma_m"),
    "pixels as a confidence": (
        seen(intrinsics=INTRINSICS, keypoints2d=Keypoints2D(range(M), project(POINTS), 4.0)),
        "give it as sigma_px",
    ),
    "a point twice in space": (seen_3d(indices=TWICE), "3D keypoints have point 1 twice"),
    "a point twice in the image": (
        seen(intrinsics=INTRINSICS, keypoints2d=Keypoints2D(TWICE, project(POINTS))),
        "2D keypoints have point 1 twice",
    ),
}


@pytest.mark.parametrize(("make", "message"), PROBABLE_MISTAKES.values(), ids=PROBABLE_MISTAKES)
def test_what_is_probably_a_mistake_brings_a_warning(make, message):
    with pytest.warns(ScopeWarning, match=message) as told:
        make()
    assert told[0].filename == __file__


NOT_REFUSED = {
    "half the confidence": seen_3d(confidence=0.5),
    "one confidence beside a deviation": seen_3d(confidence=2.0, sigma_m=0.02),
    "a point measured twice": seen_3d(
        np.concatenate([POINTS, POINTS[::-1] + 0.03]), [*range(M), *range(M - 1, -1, -1)]
    ),
    "a point twice, once without confidence": seen_3d(
        indices=TWICE, confidence=[0.0] + [1.0] * (M - 1)
    ),
    "far away": seen(keypoints3d=replace(KEYPOINTS, points=POINTS + [0.0, 0.0, 2000.0])),
    "one stray point": seen(
        keypoints3d=replace(KEYPOINTS, points=np.vstack([POINTS[:-1], [[0, 0, 9000.0]]]))
    ),
    "a skewed camera": seen_2d(moved([[0, 2.0, 0], [0, 0, 0], [0, 0, 0]])),
    "weights of zero": seen(pose_priors=pose_prior(w_R=0.0, w_t=0.0)),
    "a position without a rotation": seen(pose_priors=pose_prior(np.zeros((3, 3)), w_R=0.0)),
    "a rotation not known": seen(pose_priors=pose_prior(np.full((3, 3), NAN))),
    "a contact not known": seen(foot_contacts=FootContacts([0], np.zeros((1, 3)), [NAN])),
    "a rotation of two decimals": lambda: fit(
        BODY, SEEN, init=state(R_camera_root=rotations.exp([1.0, 0.4, 0.2]).round(2)), options=SHORT
    ),
    "no shape information": known(shape_information=np.zeros((P, P))),
    "of one direction": known(shape_information=np.outer([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])),
    "rounded": known(shape_information=np.diag([1e8, 1.0, -1e-8])),
    "no robust kernel": lambda: fit(BODY, SEEN, options=replace(SHORT, robust_keypoints3d=INF)),
    "no iterations": lambda: fit(
        BODY, SEEN, options=Options(stages=[Stage(max_iterations=0, tolerance=0.0)])
    ),
}


@pytest.mark.parametrize("make", NOT_REFUSED.values(), ids=NOT_REFUSED)
def test_what_can_be_used_passes_without_a_warning(make):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make()
