# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras in other axes, and what they measured in others, are told of before the fit."""

import re
import warnings
from functools import cache

import numpy as np
import pytest
from scope import solver
from scope.benchmarks.solver.cold_starts import CAMERA, random_person
from scope.solver import Keypoints2D, Measurements, ScopeWarning, UnitsWarning, View, rotations

WIDTH = 2.0 * CAMERA[0, 2]
OPENGL = np.diag([1.0, -1.0, -1.0])


@cache
def people():
    """A body, and a random person."""
    body = solver.load_body("scope")
    return body, random_person(body, solver.load_joint_prior(), 5000)


def as_it_is(*given):
    return given


def views_around(poses=as_it_is, pixels=lambda p: p, pitches=(0.0, 0.4, -0.3)):
    """The person in the views of three cameras, whose poses and pixels are changed."""
    _, person = people()
    views = []
    for angle, pitch in zip((-0.8, 0.1, 0.9), pitches, strict=True):
        R = rotations.exp([pitch, 0.0, 0.0]) @ rotations.exp([0.0, angle, 0.0])
        t = np.array([0.1, 0.0, 4.0]) - R @ person.points.mean(axis=0)
        p = person.points @ R.T + t
        image = pixels(p[:, :2] / p[:, 2:] * CAMERA[0, 0] + CAMERA[:2, 2])
        seen = Measurements(CAMERA, Keypoints2D(person.seen.keypoints2d.indices, image))
        views.append(View(seen, *poses(R, t)))
    return views


def from_below(p):
    return p * [1.0, -1.0] + [0.0, WIDTH]


TRANSPOSED = {"poses": lambda R, t: (R.T, t)}
CHANGES = {
    "right": ({}, None),
    "transposed": (TRANSPOSED, "transpose R_camera_world"),
    "inverted": ({"poses": lambda R, t: (R.T, -R.T @ t)}, r"R\^T and -R\^T t"),
    "the place of the camera": ({"poses": lambda R, t: (R, -R.T @ t)}, "-R_camera_world c"),
    "OpenGL": ({"poses": lambda R, t: (OPENGL @ R, OPENGL @ t)}, "give F R and F t"),
    "Blender": ({"poses": lambda R, t: (R.T @ OPENGL, -R.T @ t)}, r"give F R\^T and -F R\^T t"),
    "no place": ({"poses": lambda R, t: (R, np.zeros(3))}, "should meet; check"),
    "flipped": ({"pixels": lambda p: p * [-1.0, 1.0] + [WIDTH, 0.0]}, "from the image's left"),
    "from below": ({"pixels": from_below}, "from the image's top"),
    "row and column": ({"pixels": lambda p: p[:, ::-1]}, r"as \(x, y\) instead"),
}


@pytest.mark.parametrize(("change", "message"), CHANGES.values(), ids=CHANGES)
def test_cameras_whose_rays_miss_each_other_are_told(change, message):
    body, person = people()
    short = solver.Options(stages=[solver.Stage(max_iterations=1)])
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        solver.fit_motion(body, [views_around(**change)], [0.0], init=[person.state], options=short)
    assert len(told) == (0 if message is None else 1)
    assert message is None or re.search(message, str(told[0].message))


def test_of_wrong_cameras_nothing_else_is_told():
    """A body fits what they measured badly, but not because of an axis of the measurements."""
    with pytest.warns(ScopeWarning) as told:
        solver.fit_motion(people()[0], [views_around(**TRANSPOSED)], [0.0])
    assert len(told) == 1
    assert told[0].filename == __file__
    assert "transpose R_camera_world" in str(told[0].message)


@pytest.mark.parametrize("scale", [100.0, 1000.0])
def test_cameras_placed_in_centimetres_or_millimetres_are_told_once(scale):
    """And nothing of 3D keypoints, which were not given; however many frames and cameras."""
    views = [views_around(lambda R, t: (R, scale * t))] * 3
    with pytest.warns(UnitsWarning) as told:
        solver.fit_motion(people()[0], views, [0.0, 0.1, 0.2])
    assert len(told) == 1
    assert told[0].filename == __file__
    assert "t_camera_world" in str(told[0].message)
    assert "centimetres by 100, millimetres by 1000" in str(told[0].message)


def test_two_cameras_whose_poses_are_inverted_see_a_mirrored_person():
    """Where both look level at the person from as far away, their rays meet all the same."""
    inverted = CHANGES["inverted"][0]["poses"]
    views = views_around(lambda R, t: inverted(R, np.array([0.0, 0.0, 4.0]) - R @ [0, 0, 4.0]))
    with pytest.warns(ScopeWarning, match=r"in views, give R\^T and -R\^T t") as told:
        solver.fit_motion(people()[0], [views[:2]], [0.0])
    assert len(told) == 1
    assert told[0].filename == __file__


def test_cameras_at_one_height_that_measure_from_below_see_a_mirrored_person():
    """Their rays meet, but no body fits the points."""
    views = views_around(pixels=from_below, pitches=(0.0, 0.0, 0.0))
    with pytest.warns(ScopeWarning, match="y down"):
        solver.fit_motion(people()[0], [views], [0.0])
