# SPDX-License-Identifier: GPL-3.0-or-later
"""Visibility, angle of view and the ground truth that is written."""

from __future__ import annotations

import numpy as np
import pytest
from scope.benchmarks.scenes.draw import look_at
from scope.benchmarks.scenes.people import Person
from scope.benchmarks.scenes.scene import OUTDOORS, STATIC, TEST, Block, Scene, write_truth
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL


@pytest.fixture
def scene(body):
    """Somebody who stands at the origin and faces -y, seen from the front at 4 m, behind a box of
    half a metre.
    """
    rotations = np.tile(np.eye(3), (2, body.K + 1, 1, 1))
    rotations[:, 0] = R_WORLD_MODEL
    trans = np.tile([0.0, 0.0, 0.93] - body.rest_joints(np.zeros(body.P))[0], (2, 1))
    person = Person("stands", rotations, trans, np.zeros(body.P), 1.0, 1.0, 0.0, 0.0, 0)
    K = np.array([[600.0, 0, 319.5], [0, 600, 239.5], [0, 0, 1]])
    pose = look_at(np.array([0.0, -4.0, 0.9]), np.array([0.0, 0.0, 0.9]))
    block = Block(np.array([-1.0, -1.5, 0.0]), np.array([1.0, -1.0, 0.5]))
    return Scene(
        1,
        TEST,
        (person,),
        K,
        np.tile(pose, (2, 1, 1)),
        (640, 480),
        30.0,
        STATIC,
        OUTDOORS,
        block,
        0,
    )


def test_a_box_hides_what_a_walk_along_the_ray_meets():
    rng = np.random.default_rng(2)
    box = Block(np.array([-0.5, 1.0, 0.0]), np.array([0.5, 1.6, 1.0]))
    eye = np.array([0.2, -3.0, 1.2])
    points = rng.uniform([-2, -1, 0], [2, 4, 2], (500, 3))
    steps = eye + np.linspace(0, 1, 2001)[:, None, None] * (points - eye)
    met = ((steps > box.low) & (steps < box.high)).all(axis=-1).any(axis=0)
    assert 20 < met.sum() < 480
    assert (box.hides(eye, points) == met).mean() > 0.995


def test_the_ground_truth_projects_to_where_the_person_is(body, scene, tmp_path):
    write_truth(tmp_path / "truth.npz", body, scene)
    with np.load(tmp_path / "truth.npz") as truth:
        limbs = dict(zip(truth["names"], truth["limbs"][0, 0], strict=True))
        camera = dict(zip(truth["names"], truth["limbs_cam"][0, 0], strict=True))
    # the camera looks along +y: x to the right, y down
    for name, (x, y, z) in limbs.items():
        np.testing.assert_allclose(camera[name], [x, 0.9 - z, y + 4.0], atol=1e-9)
    # faces the camera: the left is on the picture's right
    assert limbs["left_hip"][0] > 0 > limbs["right_hip"][0]
