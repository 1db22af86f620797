# SPDX-License-Identifier: GPL-3.0-or-later
"""The probability of contact, on motions with known ground truth."""

import numpy as np
import pytest
from scope.scope_addon.kinematics import standing

from .posed_people import plank_person, stepping_person

CAMERA = np.zeros(3)


@pytest.fixture(scope="module")
def step():
    return stepping_person()


@pytest.fixture(scope="module")
def plank():
    return plank_person()


def test_a_raised_foot_is_told_from_one_in_contact(step):
    _, omega, root, place, T_world_camera, times = step
    p = standing.resting_probability(place(omega, root)[2], T_world_camera[2, :3], times, CAMERA)
    assert (p[:, 2:4] > 0.8).all()  # right
    assert (p[:, 4:] < 0.01).all()  # hands
    assert (p[:20, :2] > 0.8).all()
    assert (p[36:54, :2] < 0.3).all()
    assert (p[75:, :2] > 0.8).all()


def test_a_foot_at_rest_at_a_wrong_depth_is_in_contact_and_a_raised_one_is_not(step):
    """A foot estimated too near or too far along its line of sight seems to be above or below the
    floor.
    """
    _, omega, root, place, T_world_camera, times = step
    up = T_world_camera[2, :3]
    soles = place(omega[:1], root[:1])[2][:, :4].repeat(len(times), axis=0)
    sight = soles[:, :2] / np.linalg.norm(soles[:, :2], axis=-1, keepdims=True)
    far = soles.copy()
    far[:, :2] -= 0.35 * sight  # the left one: nearer to the camera, so higher
    higher = ((far[:, :2] - soles[:, :2]) @ up).mean()
    assert higher > 0.1
    assert (standing.standing_probability(far, up, times, CAMERA)[:, :2] > 0.5).all()
    # nobody knows where the sight is
    assert (standing.standing_probability(far, up, times)[:, :2] < 0.1).all()

    raised = soles.copy()
    raised[:, :2] += 0.35 * up
    assert (standing.standing_probability(raised, up, times, CAMERA)[:, :2] < 0.1).all()

    moving = far.copy()
    # up to 0.38 m/s, and slow where it turns round
    moving[:, :2, 0] += 0.06 * np.sin(2 * np.pi * times)[:, None]
    assert (standing.standing_probability(moving, up, times, CAMERA)[:, :2] < 0.3).all()
    at = np.array([2.0, -1.0, 3.0])
    for center in (at, np.tile(at, (len(times), 1))):
        elsewhere = standing.standing_probability(far + at, up, times, center)
        np.testing.assert_allclose(
            elsewhere, standing.standing_probability(far, up, times, CAMERA), atol=1e-9
        )


def test_both_feet_rest_on_stairs_where_the_ground_is_uneven(step):
    _, omega, root, place, T_world_camera, times = step
    up = T_world_camera[2, :3]
    stairs = place(omega[:1], root[:1])[2][:, :4].repeat(len(times), axis=0)
    stairs[:, :2] += 0.34 * up  # the left one, two steps higher
    for center in (CAMERA, None):
        assert (standing.standing_probability(stairs, up, times, center)[:, :2] < 0.2).all()
        assert (
            standing.standing_probability(stairs, up, times, center, uneven_ground=True) > 0.8
        ).all()
    moving = stairs.copy()
    moving[:, :2, 0] += 1.0 * times[:, None]
    assert (
        standing.standing_probability(moving, up, times, CAMERA, uneven_ground=True)[3:-3, :2]
        < 0.01
    ).all()


def test_palms_at_rest_on_the_floor_are_in_contact(plank):
    _, omega, root, place, T_world_camera, times = plank
    up = T_world_camera[2, :3]
    contact_points = place(omega, root)[2]
    p = standing.resting_probability(contact_points, up, times, CAMERA)
    assert p[:, [1, 3, 4, 5]].min() > 0.8  # toes and palms
    raised = contact_points.copy()
    moved = contact_points.copy()
    raised[:, 4] += 0.4 * up
    moved[:, 4, 1] += 0.3 * np.sin(2 * np.pi * times)
    for other in (raised, moved):
        p = standing.resting_probability(other, up, times, CAMERA)
        assert np.median(p[:, 4]) < 0.1
        assert p[:, 5].min() > 0.8


def s(x):
    return 1 / (1 + np.exp(-x))


def test_without_a_camera_the_probability_is_the_documented_function_of_speed_and_height():
    times = np.arange(60) / 30
    heights = np.array([0.0, 0.02, 0.05, 0.08])
    speeds = np.array([0.1, 0.35, 0.5, 0.0])
    points = np.zeros((60, 4, 3))
    points[..., 0] = times[:, None] * speeds
    points[..., 2] = heights
    p = standing.standing_probability(points, np.array([0.0, 0.0, 1.0]), times)[30]
    np.testing.assert_allclose(
        p, s(4 * (1 - speeds / 0.35)) * s(4 * (1 - heights / 0.05)), rtol=1e-6
    )
