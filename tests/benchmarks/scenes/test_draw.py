# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes are reproducible, their people are in the picture and on the floor, and the splits share
no recording.

The kinds of scenes hold their shares, and the first scenes hold them about as all do.

Visibility, angle of view and the ground truth that is written.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.benchmarks.perception.held_out import Take
from scope.benchmarks.scenes.draw import (
    FPS,
    STRIDE,
    draw_person,
    draw_scene,
    look_at,
)
from scope.benchmarks.scenes.kinds import kind_of, split_of
from scope.benchmarks.scenes.people import Person
from scope.benchmarks.scenes.scene import (
    DEVELOPMENT,
    OUTDOORS,
    STATIC,
    TEST,
    Block,
    Scene,
    write_truth,
)
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL

NUMBERS = (1, 3, 4, 6)


@pytest.fixture(scope="module")
def takes(body):
    """Recordings of somebody who strides at 1 m/s, in a world with y up; those numbered 9 and 19
    are for testing.
    """
    found = []
    for number in (0, 1, 9, 19):
        t = np.arange(80) / (STRIDE * FPS)
        poses = np.zeros((80, body.K + 1, 3))
        poses[:, body.joint_names.index("left_hip"), 0] = 0.4 * np.sin(4 * t + number)
        poses[:, body.joint_names.index("right_hip"), 0] = -0.4 * np.sin(4 * t + number)
        trans = np.stack([0 * t, 1.0 + 0 * t, t], axis=1)
        found.append(
            Take(
                number,
                f"take{number}",
                poses.reshape(80, -1),
                trans,
                np.ones(80, bool),
                np.zeros(10),
                STRIDE * FPS,
            )
        )
    return found


@pytest.fixture(scope="module")
def scenes(body, takes):
    return [draw_scene(body, takes, number) for number in NUMBERS]


def test_the_splits_share_no_recording_of_the_first_person(scenes):
    for scene in scenes:
        assert scene.split == (DEVELOPMENT if scene.number % 3 == 0 else TEST)
        assert (scene.people[0].take in ("take9", "take19")) == (scene.split == TEST)


@pytest.mark.parametrize("is_child", [False, True])
def test_people_stand_on_the_floor_whatever_their_size(body, takes, is_child):
    for seed in range(2):
        person = draw_person(
            np.random.default_rng(seed), body, takes[0], is_child, wears_loose=False
        )
        assert (person.scale < 0.86) == is_child
        lowest = [person.skin(body, f)[:, 2].min() for f in range(len(person))]
        assert min(lowest) > -0.02
        assert np.quantile(lowest, 0.05) == pytest.approx(0.0, abs=0.01)
        assert person.stature_m(body) == pytest.approx(person.scale * body.stature(person.betas))


RECORDINGS = 14


def kinds(numbers):
    return [kind_of(number, split_of(number), RECORDINGS) for number in numbers]


@pytest.mark.parametrize("split", [TEST, DEVELOPMENT])
def test_shares_hold_in_each_split(split):
    found = kinds(number for number in range(60) if split_of(number) == split)
    count = len(found)
    assert sum(kind.is_child for kind in found) == count // 5
    assert sum(kind.has_block for kind in found) == count // 4
    assert sum(kind.has_company for kind in found) == 3 * count // 10
    assert sum(kind.wears_loose for kind in found) == count // 2
    assert sum(kind.surroundings == OUTDOORS for kind in found) == count // 2
    assert sum(kind.camera == STATIC for kind in found) == 3 * count // 5


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
