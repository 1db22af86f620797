# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth flips that were put in by hand, and a body whose arm is bent in single frames."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scope.benchmarks.perception.depth_flips import (
    BONES,
    DepthFlips,
    count_flips,
    depth_flips,
    out_of_plane_deg,
    total,
)
from scope.solver.rotations import exp, log

RATE = 10.0


def counted(captured, true, rows=None):
    """The counts of one bone's angles."""
    captured, true = (np.array(deg, float)[:, None] for deg in (captured, true))
    return count_flips(
        captured, true, np.arange(len(true)) if rows is None else np.array(rows), RATE
    )


def test_the_angle_is_to_the_plane_across_the_line_of_sight():
    towards = np.array([0.6, 0.0, 0.8])  # the middle of the bone is in this direction, 5 m away
    across = np.array([0.8, 0.0, -0.6])
    for degrees in (-70.0, -15.0, 0.0, 40.0):
        half = 0.1 * (np.cos(np.radians(degrees)) * across + np.sin(np.radians(degrees)) * towards)
        assert out_of_plane_deg(5 * towards - half, 5 * towards + half) == pytest.approx(degrees)


def test_a_flip_counts_as_brief_if_it_begins_and_ends_within_the_clip():
    assert counted([30, -30, -30, 30], [30, 30, 30, 30]) == DepthFlips(1, 2, 4, 0, 0)
    # when did it begin?
    assert counted([-30, -30, 30, 30], [30, 30, 30, 30]) == DepthFlips(0, 2, 4, 0, 0)
    assert counted([30, 30, -30, -30], [30, 30, 30, 30]) == DepthFlips(0, 2, 4, 0, 0)
    assert counted([-30, 30, -30, 30, -30], [30] * 5) == DepthFlips(1, 3, 5, 0, 0)


def test_a_flip_of_a_second_is_not_brief():
    assert counted([30] + 9 * [-30] + [30], 11 * [30]).brief == 1
    assert counted([30] + 10 * [-30] + [30], 12 * [30]).brief == 0


def test_bones_near_the_image_plane_are_not_flipped():
    assert counted([30, -14, -30, 30], [30, 30, 14, 30]) == DepthFlips(0, 0, 3, 0, 0)


def test_a_gap_ends_what_is_known_of_a_flip():
    assert counted([30, -30, 30], [30, 30, 30], rows=[0, 1, 5]).brief == 0
    assert counted([30, -30, 30], [30, 30, 30], rows=[3, 4, 5]).brief == 1


def test_a_bone_crosses_the_image_plane_by_its_true_angles():
    assert counted([20, 20, 20, -20], [20, 0, -20, -20]) == DepthFlips(1, 1, 3, 1, 1)
    assert counted([20, -20, 20], [20, 10, 20]) == DepthFlips(0, 0, 2, 0, 0)


def test_no_frames_have_no_flips():
    empty = np.zeros((0, 3))
    found = count_flips(empty, empty, np.zeros(0, int), RATE)
    assert found == DepthFlips()
    assert np.isnan(found.share)
    assert total([found, DepthFlips(1, 2, 4, 3, 1), DepthFlips(0, 1, 2, 1, 0)]) == DepthFlips(
        1, 3, 6, 4, 1
    )


def test_a_forearm_that_flips_in_two_frames_fitted_alone(body):
    """The camera looks along y, at a person whose forearm points at it; in two frames it points
    away.
    """
    T = 6
    elbow = body.joint_names.index("left_elbow")
    states = np.tile(np.eye(3), (T, body.K + 1, 1, 1))
    states[:, 0] = exp(np.array([np.pi / 2, 0, 0]))  # y up becomes z up; the person faces -y
    # the left arm points to +x: the forearm swings to the front
    states[:, elbow] = exp(np.array([0, -1.0, 0]))
    trans = np.tile([0.0, 4.0, 1.0], (T, 1))
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]

    def joints_cam(states):
        return (
            body.forward_kinematics(states, trans, np.zeros(body.P))[1] @ world_from_camera[:3, :3]
        )

    wrong = states.copy()
    wrong[2:4, elbow] = exp(np.array([0, 1.0, 0]))
    motion = SimpleNamespace(
        valid=np.ones(T, bool),
        frames=np.arange(T),
        mocap_framerate=RATE,
        joints_cam=joints_cam(states),
        poses_raw=log(wrong).reshape(T, -1),
        trans_raw=trans,
        betas=np.zeros(body.P),
        world_from_camera=np.tile(world_from_camera, (T, 1, 1)),
    )
    true = {
        name: joints_cam(states)[:, body.joint_names.index(name)] for bone in BONES for name in bone
    }
    found = depth_flips(body, motion, true)
    assert (found["clip"].brief, found["clip"].flipped) == (0, 0)
    assert (found["alone"].brief, found["alone"].flipped) == (1, 2)
