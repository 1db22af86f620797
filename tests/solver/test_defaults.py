# SPDX-License-Identifier: GPL-3.0-or-later
"""What a fit does that is given only measurements, with likely mistakes in them, and what weights
mean: random people whose poses are drawn from the joint prior, seen by a camera.
"""

import warnings
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scope import solver
from scope.benchmarks.solver.cold_starts import (
    CAMERA,
    COSTLY,
    FOCAL,
    SIGMA_M,
    SIGMA_PX,
    Person,
    calibration,
    coco_of,
    farthest,
    image_of,
    markers_of,
    random_person,
    without_deviations,
)
from scope.solver import (
    COLD_STAGES,
    Floor,
    FootContacts,
    InvalidValueError,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    Options,
    PosePriors,
    Priors,
    ScopeWarning,
    Stage,
    State,
    Status,
    UnitsWarning,
    View,
    Weights,
    rotations,
)
from scope.solver.residuals import external

from .small_problem import BODY, POINTS, SEEN, K, M, P
from .synthetic import INTRINSICS

PEOPLE = 12  # among them two that the stated deviations of exact points lead to a twisted limb


@cache
def people() -> tuple[Any, list[int], list[Person]]:
    body = solver.load_body("scope")
    prior = solver.load_joint_prior()
    found = [random_person(body, prior, seed) for seed in range(PEOPLE)]
    return body, coco_of(body), found


def test_cold_starts_find_every_limb():
    body, _, everyone = people()
    plain = [without_deviations(person.seen) for person in everyone]
    assert farthest(body, everyone, plain).max() < 0.2


def test_from_the_image_alone_several_headings_find_the_lowest_cost():
    """As "multi" does always, a fit without 3D keypoints starts from several headings."""
    body, _, everyone = people()
    seen = [image_of(person) for person in everyone]
    from_truth = solver.fit_batch(body, seen, init=[person.state for person in everyone])
    found = solver.fit_batch(body, seen)
    for fit, best in zip(found, from_truth, strict=True):
        assert fit.cost <= COSTLY * best.cost
    turned = [fit for fit in found if fit.state.R_camera_root[2, 2] > 0.0]  # seen from behind
    assert len(turned) > PEOPLE / 4
    one = solver.fit(body, seen[0], init="multi")
    assert one.cost == found[0].cost


def test_where_no_heading_leads_to_the_lowest_cost_the_flipped_image_does():
    """Two of the fourteen among a thousand whom headings alone do not find."""
    body, _, _ = people()
    prior = solver.load_joint_prior()
    for seed in (10319, 10511):
        person = random_person(body, prior, seed)
        seen = replace(person.seen, keypoints3d=None)
        least = solver.fit(body, seen, init=person.state).cost
        assert solver.fit(body, seen).cost < COSTLY * least


def test_a_clip_of_2d_keypoints_alone_converges():
    """Depth is hardly fixed, so that these three take 74, 102 and 65 iterations."""
    body, index, everyone = people()
    for seed in (2, 3, 4):
        noise = SIGMA_PX * np.random.default_rng(seed).standard_normal((4, 17, 2))
        pixels = np.asarray(everyone[seed].seen.keypoints2d.pixels) + noise
        seen = Measurements(CAMERA, Keypoints2D(index, pixels, sigma_px=SIGMA_PX))
        assert solver.fit_clip(body, seen).status is Status.CONVERGED


def test_cold_starts_from_exact_points_find_every_limb():
    """Points of millimetres are taken for less exact at first, where the cost asks for it."""
    body, _, everyone = people()
    seen = [markers_of(person, body) for person in everyone]
    from_truth = solver.fit_batch(body, seen, init=[person.state for person in everyone])
    least = np.array([fit.cost for fit in from_truth])
    as_stated = solver.fit_batch(body, seen, options=Options(stages=COLD_STAGES))
    cost_as_stated = np.array([fit.cost for fit in as_stated])
    assert (cost_as_stated > COSTLY * least).any()
    cost = np.array([fit.cost for fit in solver.fit_batch(body, seen)])
    assert (cost <= COSTLY * least).all()
    assert (cost <= cost_as_stated).all()


def test_with_standard_deviations_those_of_the_result_are_calibrated():
    body, _, everyone = people()
    assert 0.8 < calibration(body, everyone) < 1.2


def test_a_standard_deviation_is_a_weight():
    body, _, everyone = people()
    seen = without_deviations(everyone[0].seen)
    with_sigmas = replace(
        seen,
        keypoints2d=replace(seen.keypoints2d, sigma_px=SIGMA_PX),
        keypoints3d=replace(seen.keypoints3d, sigma_m=np.full(17, SIGMA_M)),
    )
    weights = Weights(keypoints2d=(SIGMA_PX / FOCAL) ** -2, keypoints3d=SIGMA_M**-2)
    start = everyone[0].state
    with_weights = solver.fit(body, seen, init=start, options=Options(weights=weights))
    found = solver.fit(body, with_sigmas, init=start)
    np.testing.assert_allclose(found.t_camera_part, with_weights.t_camera_part, atol=1e-6)
    assert found.cost == pytest.approx(with_weights.cost)
    for wrong in (0.0, -1.0, np.nan, np.zeros(17)):
        spoiled = replace(seen, keypoints3d=replace(seen.keypoints3d, sigma_m=wrong))
        with pytest.raises(InvalidValueError, match="sigma_m of 3D keypoints must be positive"):
            solver.fit(body, spoiled)


def test_one_weight_changes_all_default_stages():
    weights = Weights(keypoints3d=3.0 * Weights().keypoints3d)
    options = Options(weights=weights)
    for own, default in zip(options.schedule(cold=True), COLD_STAGES, strict=True):
        assert own.weights.keypoints3d == pytest.approx(3.0 * default.weights.keypoints3d)
        assert replace(own.weights, keypoints3d=default.weights.keypoints3d) == default.weights
    assert options.schedule(cold=False)[0].weights == weights
    with pytest.raises(InvalidValueError, match=r"give each Stage its weights"):
        Options(weights=weights, stages=[Stage()])


def test_regularization_draws_a_person_to_the_population():
    body, _, everyone = people()
    seen = without_deviations(everyone[0].seen)
    assert Weights().regularized(1.0) == Weights()
    betas = []
    for strength in (1.0, 100.0):
        options = Options(weights=Weights().regularized(strength))
        betas.append(solver.fit(body, seen, init=everyone[0].state, options=options).state.beta)
    assert np.linalg.norm(betas[1]) < 0.7 * np.linalg.norm(betas[0])
    with pytest.raises(InvalidValueError, match="strength"):
        Weights().regularized(-1.0)


def height(part, ints, floats):
    return part.t[1:2] - floats


def test_contacts_a_floor_or_a_residual_of_ones_own_alone_are_measurements(monkeypatch):
    monkeypatch.setattr(external, "_external", {})
    solver.register_residual("height", function=height)
    place = np.array([[0.3, 0.2, 3.0]])
    up = np.array([0.0, -1.0, 0.0])
    kinds = {
        "contacts": Measurements(foot_contacts=FootContacts([M], place, [1.0])),
        "floor": Measurements(floor=Floor([M], up, -0.4, [1.0])),
        "own": Measurements(tables={"height": (np.array([[0]]), np.array([[0.4]]))}),
    }
    wanted = {"contacts": 0.2, "floor": 0.4, "own": 0.4}
    for name, measured in kinds.items():
        found = solver.fit(BODY, measured, priors=Priors())
        assert (found.status, found.measurements, found.seen) == (Status.CONVERGED, 1, 0), name
        assert found.t_camera_part[0, 1] == pytest.approx(wanted[name], abs=1e-3), name
        motion = solver.fit_motion(BODY, [measured] * 2, [0.0, 0.1], priors=Priors())
        assert motion.measurements.tolist() == [1, 1], name
    nothing = Measurements(foot_contacts=FootContacts([M], place, [0.0]))
    assert solver.fit(BODY, nothing, priors=Priors()).status is Status.NO_MEASUREMENTS


def pixels(values, intrinsics=INTRINSICS, confidence=1.0, sigma_px=None):
    seen = Keypoints2D(np.arange(len(values)), values, confidence, sigma_px)
    return fitted(Measurements(intrinsics, seen))


def fitted(seen, init=None):
    return lambda: solver.fit(BODY, seen, priors=Priors(), init=init)


def space(values, confidence=1.0, intrinsics=None, sigma_m=None):
    points = Keypoints3D(np.arange(M), values, confidence, sigma_m)
    return fitted(Measurements(intrinsics, keypoints3d=points))


IMAGE = POINTS[:, :2] / POINTS[:, 2:] * INTRINSICS[0, 0] + INTRINSICS[:2, 2]
SENSOR = np.diag([0.035, 0.035, 1.0]) @ INTRINSICS
SENSOR[:2, 2] = INTRINSICS[:2, 2]
HALF = np.diag([0.5, 0.5, 1.0]) @ INTRINSICS
CORNER = INTRINSICS.copy()
CORNER[:2, 2] = 0.0
UP = np.array([0.0, -1.0, 0.0])
LOWEST = float((POINTS @ UP).min())


def on_floor(normal, offset, points=POINTS, intrinsics=None, confidence=1.0):
    floor = Floor([0], normal, offset, [1.0])
    points = Keypoints3D(np.arange(M), points, confidence)
    seen = Measurements(intrinsics, keypoints3d=points, floor=floor)
    short = Options(stages=[Stage(max_iterations=1)])
    return lambda: solver.fit(BODY, seen, priors=Priors(), options=short)


def joints_as_keypoints():
    body, _, everyone = people()
    seen = Keypoints3D(np.arange(body.K + 1), everyone[0].joints)
    solver.fit(body, Measurements(keypoints3d=seen))


def joints_in_another_order():
    body, _, everyone = people()
    for person in everyone[:3]:
        seen = Keypoints3D(body.joint_names, person.joints[::-1], sigma_m=0.01)
        solver.fit(body, Measurements(keypoints3d=seen))


def intrinsics_of_half_the_size():
    body, _, everyone = people()
    solver.fit(body, replace(everyone[0].seen, intrinsics=np.diag([0.5, 0.5, 1.0]) @ CAMERA))


def numbers_of_another_detector():
    body, _, everyone = people()
    image = replace(everyone[0].seen, keypoints3d=None)
    assert image.keypoints2d is not None
    blazepose = replace(image.keypoints2d, indices=np.arange(17))
    solver.fit(body, replace(image, keypoints2d=blazepose))


def nothing_usable(pixels=IMAGE, confidence=1.0, fit=solver.fit, frames=None):
    """What a fit with the default priors and no start is given of frames without a measurement."""
    seen = Measurements(INTRINSICS, Keypoints2D(np.arange(len(pixels)), pixels, confidence))
    return lambda: fit(BODY, seen if frames is None else [seen] * frames)


def with_pose(t):
    return fitted(Measurements(pose_priors=PosePriors([0], [np.eye(3)], [t], [1.0], [1.0])))


def from_start(t):
    start = State(np.eye(3), np.asarray(t), np.tile(np.eye(3), (K, 1, 1)), np.zeros(P))
    seen = Measurements(INTRINSICS, Keypoints2D(np.arange(M), IMAGE))
    return fitted(seen, start)


MISTAKES = {
    "no principal point": (pixels(IMAGE, CORNER), ScopeWarning, "half of the image's size"),
    "normalized deviations": (pixels(IMAGE, sigma_px=2e-3), UnitsWarning, "must be in pixels"),
    "millimetres of deviation": (space(POINTS, sigma_m=20.0), UnitsWarning, "must be in metres"),
    "missing at the origin": (
        space(np.where(np.arange(M)[:, None] < 3, 0.0, POINTS)),
        ScopeWarning,
        r"are \(0, 0, 0\), .* confidence of 0",
    ),
    "one missing at the origin": (
        space(np.where(np.arange(M)[:, None] == 3, 0.0, POINTS)),
        ScopeWarning,
        r"are \(0, 0, 0\), .* confidence of 0",
    ),
    "relative to the pelvis": (
        space(POINTS - POINTS.mean(axis=0), intrinsics=INTRINSICS),
        ScopeWarning,
        "add its position",
    ),
    "joints numbered as keypoints": (joints_as_keypoints, ScopeWarning, "joint i is M "),
    "joints in the wrong order": (joints_in_another_order, ScopeWarning, "each has its own point"),
    "the intrinsics of half the size": (
        intrinsics_of_half_the_size,
        ScopeWarning,
        "intrinsics belong to pixels of this size",
    ),
    "the numbers of another detector": (
        numbers_of_another_detector,
        ScopeWarning,
        "fits the 2D keypoints badly, by .* pixels",
    ),
    "a floor's normal down": (
        on_floor(-UP, -LOWEST, intrinsics=INTRINSICS),
        ScopeWarning,
        "must point up",
    ),
    "a floor's normal down, without a camera": (
        on_floor(-UP, -LOWEST),
        ScopeWarning,
        "must point up",
    ),
    "a floor of a world with z up": (
        on_floor(np.array([0.0, 0.0, 1.0]), 3.0, intrinsics=INTRINSICS),
        ScopeWarning,
        r"about \(0, -1, 0\) in camera axes",
    ),
    "percentages of contact": (
        fitted(Measurements(foot_contacts=FootContacts([0], [[0.0, 1.0, 3.0]], [100.0]))),
        ScopeWarning,
        "foot contacts is far above 1",
    ),
    "a start in millimetres": (from_start([0.0, 0.0, 3000.0]), UnitsWarning, "init lies more"),
    "a start behind the camera": (from_start([0.0, 0.0, -3.0]), ScopeWarning, "init lies behind"),
    "a robust kernel in pixels": (
        lambda: Options(robust_keypoints2d=100.0),
        UnitsWarning,
        "robust_keypoints2d is 100, but is a squared residual",
    ),
    "a floor's offset": (on_floor(UP, LOWEST + 5.0), ScopeWarning, "below the floor"),
    "a floor in millimetres": (on_floor(UP, 1e3 * LOWEST - 400.0), UnitsWarning, "floor lies more"),
    "contacts in millimetres": (
        fitted(Measurements(foot_contacts=FootContacts([0], [[100.0, 200.0, 3000.0]], [1.0]))),
        UnitsWarning,
        "foot contacts lie more than 300 m",
    ),
    "poses in millimetres": (with_pose([0.0, 0.0, 3000.0]), UnitsWarning, "pose priors lie more"),
    "cameras in millimetres": (
        lambda: solver.fit_motion(
            BODY, [[View(SEEN, np.eye(3), [0.0, 0.0, 3000.0])]], [0.0], priors=Priors()
        ),
        UnitsWarning,
        "t_camera_world of .* lies more",
    ),
    "weights that are deviations": (
        lambda: Options(weights=Weights(keypoints2d=4.0)),
        UnitsWarning,
        "weights are 1/sigma",
    ),
    "pixels in 0..1 of a person who is partly beside the image": (
        pixels(IMAGE / 600.0),
        UnitsWarning,
        "normalized image; .* by its size",
    ),
    "missing at (0, 0)": (
        pixels(np.where(np.arange(M)[:, None] < 2, 0.0, IMAGE)),
        ScopeWarning,
        r"are \(0, 0\) or \(-1, -1\), .* confidence of 0",
    ),
    "missing at (-1, -1)": (
        pixels(np.where(np.arange(M)[:, None] < 2, -1.0, IMAGE)),
        ScopeWarning,
        r"are \(0, 0\) or \(-1, -1\), .* confidence of 0",
    ),
    "intrinsics of half the image's size": (
        pixels(IMAGE + [150.0, 0.0], HALF),
        ScopeWarning,
        r"beyond the image .* \(320, 180\); .* pixels of this size, unless the image is cropped",
    ),
    "pixels that are all NaN": (
        nothing_usable(np.full((M, 2), np.nan)),
        ScopeWarning,
        "Nothing that was measured is usable",
    ),
    "confidences of -1": (
        nothing_usable(confidence=np.full(M, -1.0)),
        ScopeWarning,
        "usable, .* confidences above 0",
    ),
    "no points": (
        nothing_usable(np.zeros((0, 2))),
        ScopeWarning,
        "Nothing that was measured is usable",
    ),
    "a clip without a measurement": (
        nothing_usable(confidence=0.0, fit=solver.fit_clip, frames=2),
        ScopeWarning,
        "Nothing that was measured is usable",
    ),
    "a motion without a measurement": (
        nothing_usable(
            confidence=0.0,
            fit=lambda body, seen: solver.fit_motion(body, seen, [0.0, 0.1]),
            frames=2,
        ),
        ScopeWarning,
        "Nothing that was measured is usable",
    ),
    "centimetres": (space(100.0 * POINTS), UnitsWarning, "divide centimetres by 100"),
    "millimetres of focal length": (pixels(IMAGE, SENSOR), UnitsWarning, "multiply millimetres"),
    "percentages": (pixels(IMAGE, confidence=np.full(M, 90.0)), ScopeWarning, "by 100"),
    "percentages in space": (space(POINTS, np.full(M, 90.0)), ScopeWarning, "by 100"),
    "behind the camera": (
        space(POINTS * [1.0, -1.0, -1.0], intrinsics=INTRINSICS),
        ScopeWarning,
        "negate y and z",
    ),
    "degrees": (lambda: rotations.exp([0.0, 90.0, 0.0]), UnitsWarning, "numpy.radians"),
}


@pytest.mark.parametrize(("make", "kind", "message"), MISTAKES.values(), ids=MISTAKES)
def test_a_likely_mistake_is_told(make, kind, message):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that nothing fits may be told, too
        with pytest.warns(kind, match=message):
            make()


RIGHT = {
    "a row that is left out at (0, 0)": pixels(
        np.where(np.arange(M)[:, None] < 2, 0.0, IMAGE),
        confidence=np.where(np.arange(M) < 2, 0.0, 1.0),
    ),
    "normalized coordinates": pixels((IMAGE - INTRINSICS[:2, 2]) / INTRINSICS[0, 0], np.eye(3)),
    "without a camera": space(POINTS * [1.0, -1.0, -1.0]),
    "weights": space(POINTS, np.full(M, 90.0), sigma_m=0.01),
    "some points behind": space(POINTS - POINTS.mean(axis=0)),
    "a floor below": on_floor(UP, LOWEST),
    "points below a floor that are left out": on_floor(
        UP,
        LOWEST,
        np.where(np.arange(M)[:, None] < 2, POINTS, POINTS - 5.0 * UP),
        confidence=np.where(np.arange(M) < 2, 1.0, 0.0),
    ),
    "a floor of other axes, without a camera": on_floor(-UP, LOWEST, POINTS * [1.0, -1.0, -1.0]),
    "a pelvis at the origin": space(POINTS - POINTS[0]),
    "a person who leaves the image at its lower edge": pixels(
        IMAGE + [0.0, 2.0 * INTRINSICS[1, 2] - np.median(IMAGE[:, 1])]
    ),
    "a frame of a motion without a measurement": lambda: solver.fit_motion(
        BODY, [SEEN, Measurements()], [0.0, 0.1]
    ),
    "cameras of a stadium": with_pose([0.0, 0.0, 120.0]),
    "two turns": lambda: rotations.exp([0.0, 4.0 * np.pi, 0.0]),
}


@pytest.mark.parametrize("make", RIGHT.values(), ids=RIGHT)
def test_what_is_right_brings_no_warning(make):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make()
