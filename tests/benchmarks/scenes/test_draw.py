# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes are reproducible, their people are in the picture and on the floor, and the splits share
no recording.
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
)
from scope.benchmarks.scenes.scene import DEVELOPMENT, TEST

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
