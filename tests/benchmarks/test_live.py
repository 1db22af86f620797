# SPDX-License-Identifier: GPL-3.0-or-later
"""The measures of live captures, on motions whose differences are known.

A simulated machine processes as many frames as its costs allow, and the same ones every time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.benchmarks.live.measures import (
    compared,
    jerk,
)
from scope.benchmarks.live.paced import Costs, EveryFrame, simulated
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.motion import Motion
from scope.solver import Body, rotations

from ..made_motion import made_motion


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


FRAME_S = 1 / 30  # of the sample clip


COSTS = Costs(
    frame_s=0.3,
    spread=0.0,
    largest_s=0.0,
    reference_s=0.0,
    estimate_s=0.0,
    first_estimate_s=0.0,
    shared=1.0,
)


def test_poses_and_latency_follow_from_the_costs(body, networks):
    recording, told = simulated(body, SAMPLE, "fast", EveryFrame, COSTS)
    assert told["poses_per_second"] == pytest.approx(10 / 3, abs=0.15)
    assert 300.0 <= told["latency_ms"]["median"] <= 1000 * (0.3 + FRAME_S)
    assert told["dropped"] == pytest.approx(8 * told["poses"], abs=9)
    again, told_again = simulated(body, SAMPLE, "fast", EveryFrame, COSTS)
    assert told_again == told
    assert again.timestamps.tolist() == recording.timestamps.tolist()
