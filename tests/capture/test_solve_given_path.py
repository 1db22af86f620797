# SPDX-License-Identifier: GPL-3.0-or-later
"""Somebody who steps aside before a camera that goes round, whose path is given: exact keypoints,
and a world that the user has chosen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.solve import solve
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.scope_addon.kinematics.axes import transform_points
from scope.solver.rotations import exp

from .standing_people import BODY, RATE, T_CAMERA_WORLD, seen, steps

pytestmark = pytest.mark.usefixtures("exact_lifting")
FRAMES = len(steps(0.0))
FLOOR_M = 0.7  # height of the floor in the given world


def orbit() -> np.ndarray:
    """(T, 4, 4) camera to the world of `steps`: it goes by 1.2 m while it keeps facing the person.

    It faces a point 3.5 m ahead of where it begins.
    """
    share = np.linspace(0.0, 1.0, FRAMES)
    poses = np.tile(np.linalg.inv(T_CAMERA_WORLD), (FRAMES, 1, 1))
    turn = exp(share[:, None] * [0.0, 0.0, 0.35])
    pivot = np.array([0.0, 3.5, 0.0])
    poses[:, :3, 3] = (turn @ (poses[:, :3, 3] - pivot)[:, :, None])[..., 0] + pivot
    poses[:, :3, :3] = turn @ poses[:, :3, :3]
    return poses


def test_a_given_path_is_kept_and_the_person_stands_in_its_world():
    poses = orbit()
    track = steps(0.0, T_camera_world=np.linalg.inv(poses))
    T_given_world = np.eye(4)
    T_given_world[:3, :3] = exp(np.array([0.0, 0.0, 0.8]))
    T_given_world[:3, 3] = [10.0, -4.0, FLOOR_M]
    given = T_given_world @ poses
    shot = replace(seen(track), path=CameraPath.given(given), T_world_first=given[0])
    solved = solve(shot, [track], lambda *_: None, [BODY.stature()])
    motion = solved.motions[0]
    assert solved.up_source == "given"

    found = motion.world_from_camera
    np.testing.assert_allclose(found[:, :3, :3], given[:, :3, :3], atol=1e-6)
    np.testing.assert_allclose(found[:, :2, 3], given[:, :2, 3], atol=1e-6)
    np.testing.assert_allclose(found[:, 2, 3], given[:, 2, 3] - FLOOR_M, atol=0.03)

    share = np.clip((np.arange(FRAMES) / RATE - 1.5) / 0.4, 0.0, 1.0)
    stands = np.stack([0.4 * share, 3.5 + 0.3 * share, np.zeros(FRAMES)], axis=1)
    pelvis = motion.trans + BODY.rest_joints(motion.betas)[0]
    way = pelvis - transform_points(T_given_world, stands)
    assert np.ptp(way, axis=0)[:2].max() < 0.08
    assert np.linalg.norm(np.median(way, axis=0)[:2]) < 0.1
