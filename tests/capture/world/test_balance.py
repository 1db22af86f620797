# SPDX-License-Identifier: GPL-3.0-or-later
"""Balance: bodies that lean away from the camera, some of which may."""

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.world.balance import balancing_rotations, center_of_mass
from scope.solver import load_body, rotations

from .placed_people import UP, bent, first_frame, placed_track

AWAY = np.array([0.0, 0.0, 1.0])
T = 60
TIMES = np.arange(T) / 30
FEET = np.tile([1.0, 1.0, 1.0, 1.0, 0.0, 0.0], (T, 1))  # stand, and hands do not


def standing(lean_deg=0.0, axis=(1.0, 0.0, 0.0), speed_m_s=0.0, arms=(0.0, 0.0, 60.0), bends=None):
    """A person standing 4 m away with arms down, leaning as a whole about the feet, and moving at
    ``speed_m_s``.

    ``arms``: the right shoulder's axis-angle, degrees; the left one mirrors it. ``bends``: of both
    hips, knees and so on, degrees about the joint's x axis.
    """
    body = load_body("scope")
    omega = np.tile(bent(body, bends or {}), (T, 1, 1, 1))
    for side, sign in (("left", -1), ("right", 1)):
        shoulder = body.joint_names.index(f"{side}_shoulder")
        omega[:, shoulder] = rotations.exp(sign * np.radians(arms))
    upright = rotations.exp([np.pi, 0.0, 0.0])  # model y up to camera y down
    lean = rotations.exp(np.radians(lean_deg) * np.array(axis))
    omega[:, 0] = lean @ upright
    R, joints = body.forward_kinematics(omega, np.zeros((T, 3)))
    feet = placed_track(body, R, joints).soles.mean(axis=(0, 1))
    root = [0, 1.0, 4.0] - feet + speed_m_s * TIMES[:, None] * [1.0, 0, 0]
    return placed_track(body, R, joints + root[:, None], omega)


def turned_deg(turn):
    """Degrees about the camera's x axis."""
    return np.degrees(rotations.log(turn))[:, 0]


def test_the_center_of_mass_is_that_of_the_volume():
    body = load_body("scope")
    placed = standing()
    R, t = body.forward_kinematics(placed.rotations[0], placed.root[0] - body.rest_joints()[0])
    v = body.skin(R, t)
    a, b, c = (v[body.faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    centroid = (volume[:, None] * (a + b + c) / 4).sum(0) / volume.sum()
    np.testing.assert_allclose(center_of_mass(body, placed.joints)[0], centroid, atol=0.05)


@pytest.mark.parametrize("lean", [-20.0, 20.0])
def test_a_body_out_of_balance_is_rotated_back_over_the_feet(lean):
    placed = standing(lean)
    turn, pivot = balancing_rotations(placed, FEET, UP)
    angle = turned_deg(turn)[T // 2]
    assert np.sign(angle) == -np.sign(lean)
    assert 3.0 < abs(angle) < 10.5
    np.testing.assert_allclose(pivot, placed.soles.mean(axis=1), atol=1e-9)
    before = (center_of_mass(placed.body, placed.joints) - pivot)[T // 2]
    after = turn[T // 2] @ before
    assert abs(after @ AWAY) < 0.75 * abs(before @ AWAY)


@pytest.mark.parametrize("lean", [-20.0, 20.0])
def test_a_camera_within_a_metre_sees_the_same_lean(lean):
    placed = standing(lean)
    near = replace(placed, center=np.tile([0.0, 0.0, 3.5], (T, 1)))
    turns = [balancing_rotations(each, FEET, UP)[0] for each in (placed, near)]
    np.testing.assert_allclose(turned_deg(turns[1]), turned_deg(turns[0]), rtol=0.01)


def ahead_of_ankles(placed):
    """Distance of the centre of mass from the ankles towards the camera, which the body faces."""
    names = placed.body.joint_names
    ankles = placed.joints[:, [names.index("left_ankle"), names.index("right_ankle")]].mean(axis=1)
    return (ankles - center_of_mass(placed.body, placed.joints))[T // 2] @ AWAY


def test_a_body_whose_mass_is_where_quiet_people_have_it_is_not_rotated():
    """Winter 2009: 4 to 6 cm ahead of the ankles."""
    leans = np.linspace(-4.0, 4.0, 17)
    bodies = [standing(lean) for lean in leans]
    ahead = np.array([ahead_of_ankles(each) for each in bodies])
    turns = [turned_deg(balancing_rotations(each, FEET, UP)[0])[T // 2] for each in bodies]
    order = np.argsort(ahead)
    quiet = np.interp(0.05, ahead[order], np.array(turns)[order])
    assert abs(quiet) < 0.5


@pytest.mark.parametrize("lean", [-6.0, 6.0])
def test_a_lean_that_keeps_the_mass_over_the_soles_is_mostly_taken_back(lean):
    """Nobody stands on toes or heels alone, though they could."""
    placed = standing(lean)
    turn, pivot = balancing_rotations(placed, FEET, UP)
    joints = pivot[:, None] + (placed.joints - pivot[:, None]) @ np.swapaxes(turn, 1, 2)
    turned = replace(placed, joints=joints)
    assert abs(ahead_of_ankles(turned) - 0.05) < 0.4 * abs(ahead_of_ankles(placed) - 0.05)


def test_a_body_with_one_foot_ahead_may_have_its_mass_anywhere_between_the_feet():
    placed = standing(0.0)
    for shift in (-0.15, 0.0, 0.15):
        points = placed.contact_points.copy()
        points[:, 0:2] += (shift + 0.2) * AWAY  # the left foot
        points[:, 2:4] += (shift - 0.2) * AWAY
        turn, _ = balancing_rotations(replace(placed, contact_points=points), FEET, UP)
        assert np.abs(turned_deg(turn)).max() < 0.5


def test_a_lean_across_the_line_of_sight_is_not_corrected():
    turn, _ = balancing_rotations(standing(20.0, axis=(0.0, 0.0, 1.0)), FEET, UP)
    assert np.abs(np.degrees(rotations.log(turn))[:, 2]).max() < 1.0
    assert np.abs(turned_deg(turn)).max() < 3.0  # as of a body at rest, whose mass is too far back


def test_a_body_that_moves_or_is_in_the_air_is_not_rotated():
    turn, _ = balancing_rotations(standing(20.0, speed_m_s=1.5), FEET, UP)
    assert np.abs(turned_deg(turn)[10:-10]).max() < 0.5  # the speed at the ends is not known well
    turn, _ = balancing_rotations(standing(20.0), np.zeros((T, 6)), UP)
    assert np.isfinite(turn).all()
    assert np.abs(turned_deg(turn)).max() < 1e-6


SITS = {"hip": -85, "knee": 85}
KNEELS = {"knee": 90, "ankle": 50}
BENDS = {"hip": -20, "knee": 40}


@pytest.mark.parametrize("bends", [SITS, KNEELS], ids=["sits", "kneels"])
@pytest.mark.parametrize("lean", [-10.0, 10.0])
def test_a_body_on_a_chair_or_on_its_shins_is_not_rotated(bends, lean):
    turn, _ = balancing_rotations(standing(lean, bends=bends), FEET, UP)
    assert np.abs(turned_deg(turn)).max() < 0.1


def test_a_body_with_slightly_bent_knees_must_be_balanced():
    turn, _ = balancing_rotations(standing(20.0, bends=BENDS), FEET, UP)
    assert turned_deg(turn)[T // 2] < -3.0


def test_a_body_on_hands_and_feet_is_not_rotated():
    """A plank towards the camera: the zero moment point is between toes and palms, far from the
    feet.
    """
    planks = standing(80.0, arms=(0.0, 90.0, 0.0))
    assert turned_deg(balancing_rotations(planks, FEET, UP)[0])[T // 2] < -3.0
    turn, pivot = balancing_rotations(planks, np.ones((T, 6)), UP)
    assert np.abs(turned_deg(turn)).max() < 0.1
    np.testing.assert_allclose(pivot, planks.contact_points.mean(axis=1), atol=1e-6)


def test_a_still_image_is_balanced_without_accelerations():
    turn, _ = balancing_rotations(first_frame(standing(20.0)), FEET[:1], UP)
    assert turned_deg(turn)[0] < -3.0


def test_a_frame_without_contact_is_rotated_about_its_own_feet():
    """As after a cut: the angle follows from neighbouring frames, but the centre of rotation must
    not be far away.
    """
    placed = standing(20.0)
    contact = FEET.copy()
    contact[T // 2] = 0.0
    _, pivot = balancing_rotations(placed, contact, UP)
    np.testing.assert_allclose(pivot, placed.soles.mean(axis=1), atol=1e-6)
