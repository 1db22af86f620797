# SPDX-License-Identifier: GPL-3.0-or-later
"""The measures of live captures, on motions whose differences are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.benchmarks.live.measures import (
    compared,
    jerk,
)
from scope.scope_addon.motion import Motion
from scope.solver import Body, rotations

from ...made_motion import made_motion


def test_jerk_of_cubics_does_not_depend_on_which_frames_are_there() -> None:
    times = np.array([0.0, 0.1, 0.25, 0.3, 0.7, 0.8, 1.0])
    joints = np.stack([3 * times**3 - times**2, times, -4 * times**3], axis=-1)[:, None]
    assert jerk(joints, times) == pytest.approx(6 * 5.0)
    assert jerk(joints[[0, 2, 3, 6]], times[[0, 2, 3, 6]]) == pytest.approx(6 * 5.0)


@pytest.fixture
def walking(body: Body) -> Motion:
    """A body that turns and moves, as a camera sees it that is not at the origin."""
    rng = np.random.default_rng(0)
    T = 12
    poses = np.cumsum(rng.normal(0, 0.02, (T, body.K + 1, 3)), axis=0)
    trans = np.cumsum(rng.normal(0, 0.02, (T, 3)), axis=0) + [0, 0, 1.0]
    motion = made_motion(body, poses, trans)
    world = body.forward_kinematics(rotations.exp(poses), trans, motion.betas)[1]
    T_camera_world = np.linalg.inv(motion.world_from_camera)
    joints = (
        np.einsum("tij,tkj->tki", T_camera_world[:, :3, :3], world) + T_camera_world[:, None, :3, 3]
    )
    return replace(motion, joints_cam=joints)


def test_a_hand_that_is_elsewhere_and_twice_the_jitter(body: Body, walking: Motion) -> None:
    """All joints but the pelvis are off by 3 cm; dropped frames are far off, and do not count."""
    off = walking.joints_cam + np.array([0.03, 0, 0], np.float32)
    off[:, 0] -= np.array([0.03, 0, 0], np.float32)
    off[5] += np.arange(body.K + 1, dtype=np.float32)[:, None]
    found = compared(replace(walking, joints_cam=off, valid=walking.frames != 5), walking, body)
    assert found["frames"] == 11
    assert found["difference"] == pytest.approx(30.0, abs=0.01)
    twice = walking.joints_cam[:, :1] + 2 * (walking.joints_cam - walking.joints_cam[:, :1])
    assert compared(replace(walking, joints_cam=twice), walking, body)["jitter"] == pytest.approx(
        2.0, rel=1e-3
    )
