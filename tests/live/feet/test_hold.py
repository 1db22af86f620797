# SPDX-License-Identifier: GPL-3.0-or-later
"""Held feet of a person whose motion is known, seen with errors of the distance.

What a body stands on draws its feet to where they rest, and keeps them above the floor.

An offset that changes abruptly is shown without a jump.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.kinematics.standing import line_of_sight
from scope.scope_addon.live.causal_fit import AFTER_A_PAUSE, FittedFrame, Support
from scope.scope_addon.live.feet import FootHold, Transition
from scope.solver import Floor, FootContacts, Measurements
from scope.solver.rotations import exp

from ...kinematics.posed_people import stepping_person

LEFT = slice(0, 2)


RIGHT = slice(2, 4)


@pytest.fixture(scope="module")
def stepped():
    """Soles (T, 4, 3) in the world, true and held, and contact (T, 6)."""
    supported, omega, root, place, T_world_camera, times = stepping_person()
    R = T_world_camera[:3, :3]
    t = T_world_camera[:3, 3]
    true = place(omega, root)[2]
    error_m = 0.04 * np.sin(2 * np.pi * 1.3 * times)
    seen = root + error_m[:, None] * line_of_sight(root)
    feet = FootHold(supported)
    held = []
    contact = []
    for k, time_s in enumerate(times):
        rays = true[k, :4, :2] / true[k, :4, 2:]
        frame = FittedFrame(omega[k], seen[k], np.ones(len(omega[k])), rays)
        rotations, p = feet.hold(time_s, np.zeros(supported.P), frame, T_world_camera, True)
        held.append(place(rotations[None], seen[k][None])[2][0, :4] @ R.T + t)
        contact.append(p)
    return (
        true[:, :4] @ R.T + t,
        np.array(held),
        np.array(contact),
        feet,
        T_world_camera,
        frame.soles,
    )


def test_a_foot_that_stands_stays_where_it_is_while_the_distance_errs(stepped):
    _, held, contact, *_ = stepped
    assert contact[5:, RIGHT].min() > 0.5
    stands = held[5:, RIGHT]
    # of errors that span 8 cm
    assert np.linalg.norm(stands - stands.mean(axis=0), axis=2).max() < 0.02


def taken_for_the_swinging_foot(lift_m):
    """Right soles (T, 2, 3) of somebody whose left foot swings past, and whose right one seems to
    follow for 4 frames.

    :param lift_m: of the body in each of these frames, which then does leave the floor.
    """
    supported, omega, root, place, T_world_camera, times = stepping_person()
    R = T_world_camera[:3, :3]
    t = T_world_camera[:3, 3]
    true = place(omega, root)[2]
    feet = FootHold(supported)
    held = []
    hip = supported.joint_names.index("right_hip")
    for k, time_s in enumerate(times[:60]):
        rays = true[k, :4, :2] / true[k, :4, 2:]
        rays[LEFT, 0] += 0.02 * max(k - 30, 0)  # 2.4 m/s at 4 m
        rotations = omega[k].copy()
        raised = 0.0
        if 40 <= k < 44:
            rays[RIGHT, 0] += 0.02
            # the foot is 8 cm aside
            rotations[hip] = rotations[hip] @ exp(np.array([0.0, 0.0, 0.09]))
        if k >= 40:
            raised = lift_m * (k - 39)
        at = root[k] + raised * R[2]
        frame = FittedFrame(rotations, at, np.ones(len(omega[k])), rays)
        shown, _ = feet.hold(time_s, np.zeros(supported.P), frame, T_world_camera, True)
        held.append(place(shown[None], at[None])[2][0, RIGHT] @ R.T + t)
    return np.array(held)


def test_a_foot_that_the_other_one_is_taken_for_stays():
    held = taken_for_the_swinging_foot(0.0)
    assert np.linalg.norm(held[36:50] - held[36], axis=2).max() < 0.01


def test_a_foot_that_leaves_the_floor_while_the_other_one_swings_is_let_go():
    held = taken_for_the_swinging_foot(0.03)  # 0.9 m/s upwards
    assert held[46, :, 2].min() > 0.1


def test_a_raised_foot_is_let_go_and_rests_again(stepped):
    true, held, contact, *_ = stepped
    assert contact[40:50, LEFT].max() < 0.3  # it is raised from 1 s to 2 s
    assert contact[75:, LEFT].min() > 0.5
    assert np.abs(held[40:50, LEFT, 2] - true[40:50, LEFT, 2]).max() < 0.03


def test_no_sole_is_below_the_floor(stepped):
    _, held, *_ = stepped
    assert held[..., 2].min() > -0.01


def test_the_next_frame_is_supported_where_feet_rest(stepped):
    _, held, _, feet, T, soles = stepped
    support = feet.support(T, soles)
    places = support.places @ T[:3, :3].T + T[:3, 3]
    assert np.linalg.norm(places[RIGHT] - held[-1, RIGHT], axis=1).max() < 0.02
    assert support.rests[:4].min() > 0.5
    assert support.rests[4:].max() == 0.0  # palms
    assert FootHold(feet._body).support(T, soles) is None


def test_a_foot_that_the_next_image_shows_elsewhere_supports_nothing(stepped):
    *_, feet, T, soles = stepped
    stepped_aside = soles.copy()
    stepped_aside[RIGHT, 0] += 0.2 / 4  # by 20 cm, 4 m away
    support = feet.support(T, stepped_aside)
    assert support.rests[RIGHT].max() < 0.01
    assert support.on_floor[RIGHT].max() < 0.01
    assert support.rests[LEFT].min() > 0.5


def test_feet_are_not_drawn_back_to_where_they_were_two_frames_a_second_ago():
    supported, omega, root, place, T, _ = stepping_person()
    feet = FootHold(supported)
    for k in range(8):
        where = root[0] + (k >= 5) * np.array([0.5, 0.0, 0.0])  # a step aside
        true = place(omega[:1], where[None])[2][0, :4]
        frame = FittedFrame(omega[0], where, np.ones(len(omega[0])), true[:, :2] / true[:, 2:])
        rotations, _ = feet.hold(0.45 * k, np.zeros(supported.P), frame, T, True)
        held = place(rotations[None], where[None])[2][0, :4]
        assert np.linalg.norm(held - true, axis=1).max() < 0.03


@pytest.mark.parametrize(("height_m", "weight"), [(0.0, AFTER_A_PAUSE), (1.5, 0.0)])
def test_after_a_pause_who_stood_on_the_floor_is_not_below_it(stepped, height_m, weight):
    *_, feet, T, soles = stepped
    higher = T.copy()
    higher[2, 3] += height_m  # the floor is that far below the feet
    support = feet.support(higher, soles).after_a_pause()
    assert not support.rests.any()
    assert not support.on_floor.any()
    assert support.not_below == pytest.approx(np.full(6, weight), abs=0.1 * AFTER_A_PAUSE)


def test_a_foot_that_is_held_where_the_image_does_not_show_it_is_let_go():
    supported, omega, root, place, T_world_camera, times = stepping_person()
    true = place(omega, root)[2][0, :4]
    feet = FootHold(supported)
    away_m = []
    is_held = True
    for k in range(60):
        # Fits stay where the feet are held; once nothing is held, they find the person 60 cm behind
        # that place.
        is_held = is_held and (k < 10 or feet.is_holding)
        at = root[0] - 0.6 * line_of_sight(root[0]) if is_held else root[0]
        frame = FittedFrame(omega[0], at, np.ones(len(omega[0])), true[:, :2] / true[:, 2:])
        shown, _ = feet.hold(times[k], np.zeros(supported.P), frame, T_world_camera, True)
        away_m.append(np.linalg.norm(place(shown[None], at[None])[2][0, :4] - true, axis=1).max())
    assert min(away_m[:10]) > 0.5
    assert max(away_m[-10:]) < 0.03
    assert feet.is_holding


POINTS = np.arange(6) + 40


SUPPORT = Support(
    places=np.arange(18.0).reshape(6, 3),
    rests=np.array([0.9, 0.8, 0.0, 0.1, 0.2, 0.0]),
    on_floor=np.array([0.7, 0.6, 0.0, 0.1, 0.0, 0.0]),
    not_below=np.array([0.5, 0.4, 0.3, 0.2, 0.1, 0.0]),
    stands=0.75,
    floor_normal=np.array([0.0, -0.8, -0.6]),
    floor_offset=-1.25,
)


def test_a_frame_gets_the_places_and_the_floor_and_keeps_the_rest() -> None:
    given = Measurements(intrinsics=np.diag([900.0, 900.0, 1.0]))
    found = SUPPORT.added_to(given, POINTS)
    assert given.floor is None
    assert found.intrinsics is given.intrinsics
    assert isinstance(found.foot_contacts, FootContacts)
    assert isinstance(found.floor, Floor)
    np.testing.assert_array_equal(found.foot_contacts.indices, POINTS)
    np.testing.assert_array_equal(found.foot_contacts.points, SUPPORT.places)
    np.testing.assert_array_equal(found.foot_contacts.probability, SUPPORT.rests)
    np.testing.assert_array_equal(found.floor.indices, POINTS)
    np.testing.assert_array_equal(found.floor.normal, SUPPORT.floor_normal)
    np.testing.assert_array_equal(found.floor.contact, SUPPORT.on_floor)
    assert found.floor.below is not None
    np.testing.assert_array_equal(found.floor.below, SUPPORT.not_below)
    assert found.floor.offset == SUPPORT.floor_offset


def test_after_a_pause_only_the_floor_is_left_and_weakly_as_far_as_somebody_stood_on_it() -> None:
    left = SUPPORT.after_a_pause()
    assert not left.rests.any()
    assert not left.on_floor.any()
    np.testing.assert_allclose(left.not_below, AFTER_A_PAUSE * 0.75)
    np.testing.assert_array_equal(left.floor_normal, SUPPORT.floor_normal)
    assert SUPPORT.rests.any()
    assert not replace(SUPPORT, stands=0.0).after_a_pause().not_below.any()


STEP_S = 1 / 600


def shown_after_change(at: int, count: int = 400) -> np.ndarray:
    """Return what is shown (count, 3) of an offset that moves at 0.5 m/s, and is 0 from a frame
    on.
    """
    transition = Transition(2, 6.0)
    shown = []
    where = np.array([True, False])
    for k in range(count):
        before, now = (
            np.array([[0.5 * j * STEP_S, 0.0, 0.0], [1.0, 1.0, 1.0]]) for j in (k - 1, k)
        )
        zero = np.array([[0.0, 0.0, 0.0], [5.0, 5.0, 5.0]])
        if k == at:
            transition.change(where, (before, now), (zero, zero), STEP_S)
        transition.advance(STEP_S)
        assert not transition.remainder[1].any()
        shown.append((now if k < at else zero)[0] + transition.remainder[0])
    return np.array(shown)


def test_position_velocity_and_acceleration_continue() -> None:
    shown = shown_after_change(at=100)[:, 0]
    velocity = np.diff(shown) / STEP_S
    acceleration = np.diff(velocity) / STEP_S
    assert np.abs(velocity[90:102] - 0.5).max() < 0.05  # as if nothing had changed
    # 30000 m/s² if the offset jumped, 300 if the velocity did
    assert np.abs(acceleration[90:99]).max() < 5.0


def test_the_remainder_dies_away() -> None:
    assert np.abs(shown_after_change(at=100)[300:]).max() < 1e-3


def test_the_course_does_not_depend_on_the_frame_rate() -> None:
    coarse = Transition(1, 6.0)
    fine = Transition(1, 6.0)
    one = np.array([[1.0, 2.0, 3.0]])
    zero = np.zeros((1, 3))
    for each in (coarse, fine):
        each.change(np.array([True]), (0.9 * one, one), (zero, zero), 0.05)
    coarse.advance(0.1)
    for _ in range(10):
        fine.advance(0.01)
    np.testing.assert_allclose(coarse.remainder, fine.remainder, atol=1e-12)
