# SPDX-License-Identifier: GPL-3.0-or-later
"""Locked feet of a motion with known truth."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.world.placement import PlacedTrack
from scope.scope_addon.kinematics.contact_points import contact_point_positions
from scope.scope_addon.live.feet.lock import LockedPoints, lock_points
from scope.solver import rotations

from ...kinematics.posed_people import FPS, stepping_person


def placed(supported, omega, root, times, center):
    """A motion of a body of mean shape, seen in every frame."""
    R, t = supported.forward_kinematics(omega, root - supported.rest_joints()[0])
    contact_points, seen = contact_point_positions(supported, R, t), np.ones((len(root), 6))
    betas, valid = np.zeros(supported.P), np.ones(len(root), bool)
    return PlacedTrack(supported, betas, times, valid, omega, root, t, contact_points, seen, center)


@pytest.mark.parametrize("turned", [0.0, 0.6, 2.5])
def test_projections_stay_when_feet_are_locked_elsewhere(turned):
    """For any direction and position of the camera: legs and distance change, the projections do not."""
    supported, omega, root, place, T_world_camera, _ = stepping_person()
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
