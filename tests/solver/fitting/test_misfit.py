# SPDX-License-Identifier: GPL-3.0-or-later
"""Mirrored and exchanged axes are told of after the fit, and unusual people who are seen rightly
are not: random people whose poses are drawn from the joint prior, and who lie or stand on the head.
"""

import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scope import solver
from scope.benchmarks.solver.cold_starts import CAMERA, random_person, without_deviations
from scope.solver import (
    Keypoints2D,
    Keypoints3D,
    Measurements,
    OrientationField,
    ScopeWarning,
    rotations,
)
from scope.solver.residuals import external

WIDTH = 2.0 * CAMERA[0, 2]
PEOPLE = 3


@cache
def people():
    body = solver.load_body("scope")
    prior = solver.load_joint_prior()
    return body, [random_person(body, prior, 5000 + seed) for seed in range(PEOPLE)]


def in_space(m, change):
    points = m.keypoints3d
    return replace(m, keypoints3d=replace(points, points=change(points.points)))


def in_image(m, change):
    return replace(m, keypoints2d=replace(m.keypoints2d, pixels=change(m.keypoints2d.pixels)))


def only_3d(m):
    return Measurements(keypoints3d=m.keypoints3d)


def from_right(p):
    return p * [-1.0, 1.0] + [WIDTH, 0.0]


def from_below(p):
    return p * [1.0, -1.0] + [0.0, WIDTH]


def row_and_column(p):
    return p[:, ::-1]


def left_handed(p):
    return p * [-1.0, 1.0, 1.0]


def y_up(p):
    return p * [1.0, -1.0, 1.0]


def mirrored_at_the_root(p):
    center = p.mean(axis=0)
    return left_handed(p - center) + center


MISTAKES = {
    "3D alone, x to the left": (lambda m: in_space(only_3d(m), left_handed), "negate one axis"),
    "3D alone, y up": (lambda m: in_space(only_3d(m), y_up), "negate one axis"),
    "3D of both, x to the left": (lambda m: in_space(m, left_handed), "negate one axis"),
    "3D of both, y up": (lambda m: in_space(m, y_up), "negate one axis"),
    "3D of both, about the root": (lambda m: in_space(m, mirrored_at_the_root), "negate one axis"),
    "2D of both, flipped": (lambda m: in_image(m, from_right), "from the image's left"),
    "2D of both, from below": (lambda m: in_image(m, from_below), "from the image's top"),
    "2D of both, row and column": (lambda m: in_image(m, row_and_column), r"as \(x, y\) instead"),
    "both flipped": (
        lambda m: in_image(in_space(m, left_handed), from_right),
        "flip back the image",
    ),
}


@pytest.mark.parametrize(("change", "message"), MISTAKES.values(), ids=MISTAKES)
def test_mirrored_measurements_are_told(change, message):
    body, everyone = people()
    seen = everyone[0].seen
    for each in (seen, without_deviations(seen)):
        with pytest.warns(ScopeWarning, match=message) as told:
            solver.fit(body, change(each))
        assert told[0].filename == __file__


IMAGE_MISTAKES = {
    "from below": (from_below, "from the image's top"),
    "row and column": (row_and_column, r"as \(x, y\) instead"),
}


@pytest.mark.parametrize(("change", "message"), IMAGE_MISTAKES.values(), ids=IMAGE_MISTAKES)
def test_of_several_frames_2d_keypoints_alone_show_it(change, message):
    body, everyone = people()
    frames = [in_image(replace(each.seen, keypoints3d=None), change) for each in everyone]
    with pytest.warns(ScopeWarning, match=message) as told:
        solver.fit_batch(body, frames)
    assert told[0].filename == __file__


def left_for_right(p):
    """COCO's keypoints, nose first, then pairs."""
    return p[[0, *(k + 1 if k % 2 else k - 1 for k in range(1, 17))]]


@pytest.mark.parametrize("change", [from_right, left_for_right])
def test_of_some_people_2d_keypoints_alone_show_that_left_and_right_are_exchanged(change):
    """Of most, the body that faces the other way fits as well."""
    body, everyone = people()
    seen = [replace(each.seen, keypoints3d=None) for each in everyone]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for each in seen:
            solver.fit(body, each)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        for each in seen:
            solver.fit(body, in_image(each, change))
    assert "exchange left and right in the names" in " ".join(str(each.message) for each in told)


def rolled(person, turns):
    """The measurements of a camera that is rolled by quarter turns."""
    R = rotations.exp([0.0, 0.0, 0.5 * np.pi * turns])
    center = CAMERA[:2, 2]
    seen = in_image(person.seen, lambda p: (p - center) @ R[:2, :2].T + center)
    return in_space(seen, lambda p: p @ R.T)


@pytest.mark.parametrize("turns", [1, 2])
def test_people_who_lie_or_stand_on_the_head_are_no_mistake(turns):
    body, everyone = people()
    seen = [rolled(person, turns) for person in everyone]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for each in seen[:2]:
            solver.fit(body, each)
            solver.fit(body, only_3d(each))
            solver.fit(body, without_deviations(each))
        solver.fit_batch(body, [replace(each, keypoints3d=None) for each in seen])


def test_a_residual_of_ones_own_in_millimetres_is_told(monkeypatch):
    """It draws the body half a kilometre away from all that was seen."""
    monkeypatch.setattr(external, "_external", {})
    body, everyone = people()
    hand = body.joint_names.index("left_hand")
    solver.register_residual(
        "height",
        function=lambda part, ints, floats: floats[1:] ** 0.5 * (part.t[1:2] - floats[0]),
        ints=1,
        floats=2,
        indexes="parts",
    )
    person = everyone[0]

    def fit(height):
        rows = {"height": ([[hand]], [[height, 1e5]])}
        return solver.fit(body, replace(only_3d(person.seen), tables=rows))

    fit(person.joints[hand, 1])
    with pytest.warns(ScopeWarning, match="residuals of your own are in metres"):
        fit(1000.0 * person.joints[hand, 1])


def test_noise_that_is_larger_than_stated_is_no_mirror():
    body, everyone = people()
    rng = np.random.default_rng(0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", "A body fits")
        for person in everyone:
            noise = 0.05 * rng.standard_normal((17, 3))
            seen = in_space(without_deviations(person.seen), lambda p, noise=noise: p + noise)
            solver.fit(body, only_3d(seen))


def test_mirrored_directions_are_told():
    body, everyone = people()
    t = everyone[0].joints
    child = np.arange(1, body.K + 1)
    parent = np.asarray(body.parents)[child]
    first = len(body.keypoint_names)
    directions = left_handed(t[child] - t[parent])
    seen = Measurements(
        orientation_field=OrientationField(first + parent, first + child, directions)
    )
    with pytest.warns(ScopeWarning, match="negate one axis"):
        solver.fit(body, seen)


UNLIKELY = {
    "feet for metres": lambda p: only_3d(in_space(p.seen, lambda q: 3.28 * q)),
    "COCO's numbers for the body's, in space": lambda p: Measurements(
        keypoints3d=Keypoints3D(range(17), p.points)
    ),
}


@pytest.mark.parametrize("change", UNLIKELY.values(), ids=UNLIKELY)
def test_what_only_a_body_unlike_any_fits_is_told(change):
    body, everyone = people()
    with pytest.warns(ScopeWarning, match="standard deviations from the mean of people"):
        solver.fit(body, change(everyone[0]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda person: in_space(only_3d(person.seen), y_up), "negate one axis"),
        (UNLIKELY["feet for metres"], "from the mean of people"),
    ],
)
def test_clips_motions_and_batches_are_told_as_well(change, message):
    body, everyone = people()
    frames = [change(everyone[0])] * 3
    for fit in (
        solver.fit_clip,
        solver.fit_batch,
        lambda body, frames: solver.fit_motion(body, frames, [0.0, 0.1, 0.2]),
    ):
        with pytest.warns(ScopeWarning, match=message):
            fit(body, frames)


def test_pixels_that_have_the_numbers_of_other_points_are_told():
    body, everyone = people()
    seen = Measurements(CAMERA, Keypoints2D(range(17), everyone[0].seen.keypoints2d.pixels))
    with pytest.warns(ScopeWarning, match="2D keypoints badly.* its own point"):
        solver.fit(body, seen)


def test_masked_points_are_no_misfit():
    """Most are masked, and hold numbers that lie a metre beside the body."""
    body = solver.load_body("scope")
    state = solver.State.rest(body.K, body.P)
    R = np.concatenate([state.R_camera_root[None], state.Omega])
    root = state.t_camera_root - body.rest_joints(state.beta)[0]
    points = np.ma.array(body.forward_kinematics(R, root, state.beta)[1])
    points[8:] += 1.0
    points[8:] = np.ma.masked
    seen = solver.Measurements(keypoints3d=solver.Keypoints3D(body.joint_names, points))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        solver.fit(body, seen, init=state)
