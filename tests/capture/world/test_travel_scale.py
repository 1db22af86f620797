# SPDX-License-Identifier: GPL-3.0-or-later
"""The scale of a camera's path from a floor and from feet, and strides that contradict a path."""

from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.odometry import Odometry
from scope.scope_addon.capture.world.travel_scale import (
    FEET,
    FLOOR,
    NOTHING,
    _fitted_plane,
    belt_travel,
    contradicting_strides,
    find_floor,
    scaled_travel,
    walking_speed,
)
from scope.solver.rotations import exp

UP = np.array([0.0, -1.0, 0.0])
T = 120
TIMES = np.arange(T) / 30.0
HEIGHT_M = 1.5  # of the camera above the floor
SCALE = 2.3  # metres per unit of the map
SPEED_M_S = 1.3


def walk(shortened=1.0):
    """(T, 4, 3) soles of somebody who walks along +z, 4 m ahead of the first camera; strides along
    the line of sight may be seen too short.
    """
    soles = np.zeros((T, 4, 3))
    for point in range(4):
        shift = 0.5 * (point // 2)
        phase = TIMES + shift
        share = phase % 1.0
        swing = np.clip((share - 0.6) / 0.4, 0, 1)
        ahead = (np.floor(phase) + swing + 0.3 - shift) * SPEED_M_S
        body = SPEED_M_S * TIMES
        z = 4.0 + body + shortened * (ahead - body) + 0.2 * (point % 2)
        lift = 0.12 * np.sin(np.pi * swing)
        side = np.full(T, 0.1 - 0.2 * (point // 2))
        soles[:, point] = np.stack([side, HEIGHT_M - lift, z], axis=1)
    return soles


CENTER = TIMES[:, None] * [0.0, 0.0, SPEED_M_S]  # of a camera that follows at the walker's speed


def room():
    """Corners in units of the map: 80 of a floor, 30 of table tops, and 150 of walls."""
    rng = np.random.default_rng(0)
    floor = np.stack(
        [rng.uniform(-3, 3, 80), np.full(80, HEIGHT_M), rng.uniform(1, 14, 80)], axis=1
    )
    table = np.stack(
        [rng.uniform(1, 3, 30), np.full(30, HEIGHT_M - 0.75), rng.uniform(3, 6, 30)], axis=1
    )
    wall = np.stack(
        [np.full(150, -3.0), rng.uniform(-1.5, HEIGHT_M, 150), rng.uniform(1, 14, 150)], axis=1
    )
    places = np.concatenate([floor, table, wall])
    return (places + 0.004 * rng.standard_normal(places.shape)) / SCALE


ROOM = room()
WALLS = ROOM[110:]


def travel(places):
    """How the camera follows, as the background shows it."""
    still = np.tile(np.eye(3), (T, 1, 1))
    return Odometry(still, CENTER / SCALE, np.zeros(T, int), [places])


def placed(soles, root):
    """What is read of a motion whose pelvis faces +z."""
    facing = np.tile(np.eye(3), (T, 1, 1, 1))
    return SimpleNamespace(
        soles=soles, root=root, times=TIMES, valid=np.ones(T, bool), rotations=facing
    )


def follower(shortened=1.0):
    """The walker, relative to a camera that follows at the same speed."""
    return placed(walk(shortened) - CENTER[:, None], np.tile([0.0, 0.6, 4.0], (T, 1)))


def largest_error(found):
    """The largest distance of the travel from the true one, as a share of that."""
    return np.abs(found.center - CENTER).max() / CENTER[-1, 2]


@pytest.mark.parametrize("shortened", [1.0, 0.65])
def test_the_floor_tells_the_scale_however_long_strides_seem(shortened):
    tilted = exp([0.1, 0.0, 0.0]) @ UP  # as the up direction of a body may be
    found = scaled_travel(follower(shortened), tilted, travel(ROOM), treadmill=False)
    assert largest_error(found) < 0.03
    assert np.degrees(np.arccos(found.floor_up @ UP)) < 1.0
    assert found.source == FLOOR


def test_without_a_floor_the_feet_tell_it():
    found = scaled_travel(follower(), UP, travel(WALLS), treadmill=False)
    assert largest_error(found) < 0.1
    assert found.floor_up is None
    assert found.source == FEET


def test_a_floor_of_few_corners_tells_it_where_strides_seem_much_too_short():
    """As of somebody who comes towards the camera, whose feet hardly swing in the picture."""
    places = np.concatenate([ROOM[:16], ROOM[80:]])
    found = scaled_travel(follower(0.4), UP, travel(places), treadmill=False)
    assert found.source == FLOOR
    assert largest_error(found) < 0.03


def test_the_cadence_tells_it_where_strides_along_the_line_of_sight_seem_much_too_short():
    """Steps alone would tell a third to a half of it."""
    for shortened in (0.5, 0.3):
        found = scaled_travel(follower(shortened), UP, travel(WALLS), treadmill=False)
        assert found.source == FEET
        assert found.center[-1, 2] == pytest.approx(CENTER[-1, 2], rel=0.25)


def test_people_walk_as_fast_as_their_cadence_tells():
    """The step of an adult at 110 steps per minute is 0.71 m long."""
    step_s = 60 / 110
    assert walking_speed(np.arange(8) * step_s) == pytest.approx(0.71 / step_s, rel=0.02)
    assert walking_speed(np.arange(8) * 2.0) == 0.0
    assert walking_speed(np.arange(2) * step_s) == 0.0


def test_a_scale_that_nobody_tells_is_said_to_be_unknown():
    unseen = follower()
    unseen.valid[:] = False
    found = scaled_travel(unseen, UP, travel(WALLS), treadmill=False)
    assert found.source == NOTHING
    np.testing.assert_array_equal(found.center, 0.0)


def test_on_a_treadmill_the_floor_alone_tells_it():
    found = scaled_travel(follower(), UP, travel(WALLS), treadmill=True)
    assert found.source == NOTHING
    np.testing.assert_array_equal(found.center, 0.0)
    found = scaled_travel(follower(), UP, travel(ROOM), treadmill=True)
    assert found.source == FLOOR
    assert largest_error(found) < 0.03


def test_a_belt_does_not_run_in_the_gap_at_a_scene_cut():
    """A capture adds ten seconds to the times there."""
    person = placed(walk(), np.tile([0.0, 0.6, 4.0], (T, 1)))
    person.times = TIMES + np.where(np.arange(T) < 60, 0.0, 10.0)
    travel = belt_travel(person, UP, 3.0)
    assert np.linalg.norm(travel[-1]) == pytest.approx(3.0 * TIMES[-1], abs=0.2)
    assert np.linalg.norm(np.diff(travel, axis=0), axis=1).max() < 0.11


def test_the_floor_of_a_long_path_takes_little_memory():
    """All pairs of 60,000 corners would take 27 GiB."""
    rng = np.random.default_rng(3)
    flat = rng.normal(size=(60_000, 3)) * [5.0, 0.01, 5.0]
    floor = _fitted_plane(flat + [0.0, -1.0, 0.0], np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(floor.normal, [0.0, 1.0, 0.0], atol=1e-3)
    assert floor.offset == pytest.approx(-1.0, abs=1e-3)


def test_corners_along_a_line_are_no_floor():
    """As those of a caption at the bottom of the picture: planes of any tilt go through a line."""
    path = CENTER / SCALE
    found = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        line = np.stack([rng.uniform(-2, 2, 40), np.full(40, 0.6), np.full(40, 1.5)], axis=1)
        found.append(find_floor(line + 0.002 * rng.standard_normal(line.shape), path, UP))
    for floor in found:
        assert floor is None or floor.normal @ UP > np.cos(np.radians(16.0))
    assert sum(floor is None for floor in found) > 10


def test_strides_on_the_spot_contradict_a_path_that_stands_still():
    assert not contradicting_strides(placed(walk(), CENTER), UP).any()
    assert not contradicting_strides(placed(walk(0.65), CENTER), UP).any()
    on_the_spot = contradicting_strides(placed(walk(0.65) - CENTER[:, None], 0.0 * CENTER), UP)
    assert on_the_spot.mean() > 0.9
