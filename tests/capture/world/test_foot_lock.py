# SPDX-License-Identifier: GPL-3.0-or-later
"""Foot locking on motions with known ground truth."""

import numpy as np
import pytest
from scope.scope_addon.capture.world.foot_lock import LockedPoints, lock_feet, lock_points
from scope.scope_addon.capture.world.placement import PlacedTrack
from scope.scope_addon.kinematics import standing
from scope.scope_addon.kinematics.axes import transform_points
from scope.scope_addon.kinematics.contact_points import contact_point_positions
from scope.scope_addon.kinematics.smoothing import gaussian_smooth
from scope.solver import rotations

from ...kinematics.posed_people import FPS, plank_person, stepping_person

CAMERA = np.zeros(3)


def placed(supported, omega, root, times, center):
    """A motion of a body of mean shape, seen in every frame."""
    R, t = supported.forward_kinematics(omega, root - supported.rest_joints()[0])
    contact_points, seen = contact_point_positions(supported, R, t), np.ones((len(root), 6))
    betas, valid = np.zeros(supported.P), np.ones(len(root), bool)
    return PlacedTrack(supported, betas, times, valid, omega, root, t, contact_points, seen, center)


def locked(supported, omega, root, contact, T_world_camera, times):
    """Rotations and root of the motion with its feet locked, for a static camera."""
    found = lock_feet(placed(supported, omega, root, times, np.zeros((len(root), 3))), contact, T_world_camera)
    return found.rotations, found.root


@pytest.fixture(scope="module")
def step():
    return stepping_person()


@pytest.fixture(scope="module")
def plank():
    return plank_person()


def test_the_feet_of_a_trembling_motion_are_at_rest_in_contact(step):
    supported, omega, root, place, T_world_camera, times = step
    rng = np.random.default_rng(1)
    noise = gaussian_smooth(rng.normal(size=(len(times), supported.K + 1, 3)), times, 4.5)
    shaken = omega @ rotations.exp(0.06 * noise)
    # across the line of sight, the picture tells better than 3 mm where somebody is
    sight = standing.line_of_sight(root)
    trembling = gaussian_smooth(rng.normal(size=root.shape), times, 4.5)
    shaken_root = root + 0.003 * trembling + 0.02 * trembling[:, :1] * sight
    contact = standing.resting_probability(place(omega, root)[2], T_world_camera[2, :3], times, CAMERA)
    local, moved = locked(supported, shaken, shaken_root, contact, T_world_camera, times)
    before, after = (
        transform_points(T_world_camera, place(*m)[2][:, 2]) for m in ((shaken, shaken_root), (local, moved))
    )
    assert after.std(0).max() < 0.4 * before.std(0).max()
    assert np.abs(after[:, 2]).max() < 0.015  # on the floor
    assert np.abs(place(local, moved)[1] - place(shaken, shaken_root)[1]).max() < 0.2  # nobody was thrown about


@pytest.mark.parametrize("turned", [0.0, 0.6, 2.5])
def test_projections_stay_when_feet_are_locked_elsewhere(step, turned):
    """For any direction and position of the camera: legs and distance change, the projections do not."""
    supported, omega, root, place, T_world_camera, _ = step
    R, center = rotations.exp(np.array([0.0, turned, 0.0])), np.array([1.0, -0.2, 0.5])
    omega, root = omega[:3].copy(), root[:3] @ R.T + center
    omega[:, 0] = R @ omega[:, 0]
    up, soles = R @ T_world_camera[2, :3], place(omega, root)[2]
    for away in (-0.03, 0.03):
        held = soles + away * up
        weights = np.tile([0.9, 0.9, 0.9, 0.9, 0.0, 0.0], (len(root), 1))
        targets = LockedPoints(held, weights, up, np.full(len(root), float((held @ up).min())))
        times, centers = np.arange(len(root)) / FPS, np.tile(center, (len(root), 1))
        local, moved = lock_points(placed(supported, omega, root, times, centers), targets)
        for joint in ("head", "left_wrist", "right_hip"):
            j = supported.joint_names.index(joint)
            was, now = ((place(*m)[1][:, j] - center) @ R for m in ((omega, root), (local, moved)))
            shift = now[:, :2] / now[:, 2:] - was[:, :2] / was[:, 2:]
            assert np.abs(shift).max() < 0.006 / 4, joint
        assert np.abs((place(local, moved)[2] - held)[:, :4] @ up).max() < 0.022


@pytest.mark.parametrize("level", [-1.8, -0.5, 0.6])
def test_feet_on_another_level_are_not_moved_to_the_floor(step, level):
    """The person stands on the floor, then, for the second half, on a wall or in a pit."""
    supported, omega, root, place, T_world_camera, times = step
    up = T_world_camera[2, :3]
    other = root + np.where(times > 1.5, level, 0.0)[:, None] * up
    soles = place(omega, other)[2]
    contact = standing.resting_probability(soles, up, times, CAMERA)
    local, moved = locked(supported, omega, other, contact, T_world_camera, times)
    after = transform_points(T_world_camera, place(local, moved)[2])
    before = transform_points(T_world_camera, soles)
    assert np.abs(after[:, 2:, 2] - before[:, 2:, 2]).max() < 0.06
    assert np.abs(after[60:, 2, 2] - level).max() < 0.06
    assert np.abs(after[:30, 2, 2]).max() < 0.03


def test_a_still_and_a_single_frame_pass(step):
    supported, omega, root, place, T_world_camera, times = step
    contact = standing.resting_probability(place(omega[:1], root[:1])[2], T_world_camera[2, :3], times[:1], CAMERA)
    local, moved = locked(supported, omega[:1], root[:1], contact, T_world_camera, times[:1])
    assert np.allclose(place(local, moved)[2][0, 2:4] @ T_world_camera[2, :3] + 1.5, 0, atol=0.02)


def test_trembling_palms_are_locked_on_the_floor(plank):
    supported, omega, root, place, T_world_camera, times = plank
    rng = np.random.default_rng(2)
    noise = gaussian_smooth(rng.normal(size=(len(times), supported.K + 1, 3)), times, 4.5)
    shaken = omega @ rotations.exp(0.06 * noise)
    contact = standing.resting_probability(place(omega, root)[2], T_world_camera[2, :3], times, CAMERA)
    local, moved = locked(supported, shaken, root, contact, T_world_camera, times)
    before, after = (transform_points(T_world_camera, place(*m)[2][:, 4:]) for m in ((shaken, root), (local, moved)))
    assert after.std(0).max() < 0.4 * before.std(0).max()
    assert np.abs(after[..., 2]).max() < 0.03
