# SPDX-License-Identifier: GPL-3.0-or-later
"""Held feet of a person whose motion is known, seen with errors of the distance.

What a body stands on draws its feet to where they rest, and keeps them above the floor.

An offset that changes abruptly is shown without a jump.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.arrays import unit_vectors
from scope.scope_addon.live.causal_fit import AFTER_A_PAUSE, FittedFrame
from scope.scope_addon.live.feet import FootHold, Transition

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
    seen = root + error_m[:, None] * unit_vectors(root)
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


def test_a_raised_foot_is_let_go_and_rests_again(stepped):
    true, held, contact, *_ = stepped
    assert contact[40:50, LEFT].max() < 0.3  # it is raised from 1 s to 2 s
    assert contact[75:, LEFT].min() > 0.5
    assert np.abs(held[40:50, LEFT, 2] - true[40:50, LEFT, 2]).max() < 0.03


def test_the_next_frame_is_supported_where_feet_rest(stepped):
    _, held, _, feet, T, soles = stepped
    support = feet.support(T, soles)
    places = support.places @ T[:3, :3].T + T[:3, 3]
    assert np.linalg.norm(places[RIGHT] - held[-1, RIGHT], axis=1).max() < 0.02
    assert support.rests[:4].min() > 0.5
    assert support.rests[4:].max() == 0.0  # palms
    assert FootHold(feet._body).support(T, soles) is None


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
        at = root[0] - 0.6 * unit_vectors(root[0]) if is_held else root[0]
        frame = FittedFrame(omega[0], at, np.ones(len(omega[0])), true[:, :2] / true[:, 2:])
        shown, _ = feet.hold(times[k], np.zeros(supported.P), frame, T_world_camera, True)
        away_m.append(np.linalg.norm(place(shown[None], at[None])[2][0, :4] - true, axis=1).max())
    assert min(away_m[:10]) > 0.5
    assert max(away_m[-10:]) < 0.03
    assert feet.is_holding


POINTS = np.arange(6) + 40


STEP_S = 1 / 600


def shown_after_change(at: int, count: int = 400) -> np.ndarray:
    """Return what is shown (count, 3) of an offset that moves at 0.5 m/s, and is 0 from a frame
    on.
    """
    transition = Transition(2)
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


def test_the_course_does_not_depend_on_the_frame_rate() -> None:
    coarse = Transition(1)
    fine = Transition(1)
    one = np.array([[1.0, 2.0, 3.0]])
    zero = np.zeros((1, 3))
    for each in (coarse, fine):
        each.change(np.array([True]), (0.9 * one, one), (zero, zero), 0.05)
    coarse.advance(0.1)
    for _ in range(10):
        fine.advance(0.01)
    np.testing.assert_allclose(coarse.remainder, fine.remainder, atol=1e-12)
