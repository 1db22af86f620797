# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes are reproducible, their people are in the picture and on the floor, and the splits share
no recording.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.benchmarks.perception.held_out import Take
from scope.benchmarks.scenes.draw import (
    APART_M,
    FPS,
    MAX_HIDDEN,
    STRIDE,
    draw_person,
    draw_scene,
    look_at,
)
from scope.benchmarks.scenes.scene import DEVELOPMENT, NEW_PERFORMERS, STATIC, TEST

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


def test_a_number_gives_the_same_scene_again(body, takes, scenes):
    again = draw_scene(body, takes, NUMBERS[0])
    np.testing.assert_array_equal(again.world_from_camera, scenes[0].world_from_camera)
    np.testing.assert_array_equal(again.people[0].trans, scenes[0].people[0].trans)
    assert not np.allclose(scenes[1].people[0].betas, scenes[0].people[0].betas)


def test_the_splits_share_no_recording_of_the_first_person(scenes):
    for scene in scenes:
        assert scene.split == (DEVELOPMENT if scene.number % 3 == 0 else TEST)
        assert (scene.people[0].take in ("take9", "take19")) == (scene.split == TEST)


def test_scenes_of_new_performers_show_each_of_them(body, takes):
    known = [
        replace(take, performer="one" if k < 2 else "two", name=f"take{k}")
        for k, take in enumerate(takes)
    ]
    found = [draw_scene(body, known, number, NEW_PERFORMERS) for number in range(4)]
    assert [scene.name for scene in found] == [
        f"new_performers_{number:02d}" for number in range(4)
    ]
    performers = ["one" if scene.people[0].take in ("take0", "take1") else "two" for scene in found]
    assert sorted(performers[:2]) == sorted(performers[2:]) == ["one", "two"]


def test_the_first_person_is_in_the_picture_and_nobody_too_near(body, scenes):
    for scene in scenes:
        for k, person in enumerate(scene.people):
            skin = np.array([person.skin(body, f)[::20] for f in range(len(scene))])
            camera = scene.to_camera(skin)
            assert camera[..., 2].min() > 0.8
            if k == 0:
                pixels = scene.project(camera)
                assert pixels.min() > -2
                assert (pixels.max((0, 1)) < np.array(scene.size) + 2).all()


def test_static_cameras_stand_still_and_others_do_not(scenes):
    for scene in scenes:
        moved = np.ptp(scene.world_from_camera, axis=0).max()
        assert (moved == 0.0) == (scene.camera == STATIC)


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


def test_people_walk_as_fast_as_in_the_recording(body, takes):
    person = draw_person(np.random.default_rng(0), body, takes[0], is_child=False, wears_loose=True)
    walked = np.linalg.norm(np.diff(person.trans, axis=0), axis=1) * FPS
    legs = [
        body.rest_joints(betas)[
            [body.joint_names.index(f"left_{part}") for part in ("hip", "knee", "ankle")]
        ]
        for betas in (person.betas, takes[0].betas)
    ]
    ratio = np.divide(*[np.linalg.norm(np.diff(chain, axis=0), axis=1).sum() for chain in legs])
    np.testing.assert_allclose(walked, ratio, rtol=1e-6)  # the performer walks 1 m/s
    assert person.loose_m > 0


def test_a_block_hides_some_joints_of_the_first_person_but_not_most(body, scenes):
    blocked = [scene for scene in scenes if scene.block is not None]
    assert blocked
    for scene in blocked:
        assert scene.hidden(scene.people[0], body).mean() <= MAX_HIDDEN


def test_people_keep_apart(body, scenes):
    pairs = [scene.people for scene in scenes if len(scene.people) == 2]
    for first, second in pairs:
        a, b = (person.joints(body)[:, :, :2] for person in (first, second))
        assert np.linalg.norm(a[:, :, None] - b[:, None], axis=-1).min() > 0.9 * APART_M


def test_a_camera_looks_at_its_target_and_is_level():
    T = look_at(np.array([1.0, -4.0, 1.5]), np.array([0.5, 0.3, 0.9]))
    np.testing.assert_allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
    x, y, z = np.linalg.inv(T)[:3] @ [0.5, 0.3, 0.9, 1.0]
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert z == pytest.approx(np.linalg.norm([0.5, 4.3, 0.6]))
    assert T[2, 0] == pytest.approx(0.0)  # its x axis is horizontal
    assert T[2, 1] < 0  # and its y axis points down
