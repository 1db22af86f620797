# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses that smoothing has delayed, at the times of their frames, and the rows of a recording."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera, pinhole
from scope.scope_addon.kinematics.axes import world_from_level_camera
from scope.scope_addon.kinematics.contact_points import contact_point_positions, with_contact_points
from scope.scope_addon.live.pose import Presence
from scope.scope_addon.live.recording import Recording, at_frames, in_last_shape
from scope.solver import rotations

from .test_vmc import pose_of


def pose_given(body, index, time_s, delay_s, betas=None):
    """A body that turns by 2 rad/s and moves by 1 m/s, as it was ``delay_s`` before its frame."""
    then = time_s - delay_s
    turned = rotations.exp([0.0, 0.0, 2.0 * then % (2.0 * np.pi)])
    return replace(
        pose_of(body, R_world_root=turned, pelvis=(then, 0.0, 4.0)),
        index=index,
        timestamp_s=time_s,
        betas=np.zeros(body.P) if betas is None else betas,
        T_world_camera=world_from_level_camera(np.array([0.0, -1.0, 0.0]), height=1.0),
        raw_root_cam=np.zeros(3),
        keypoints=np.full((33, 3), index),
        joint_confidence=np.ones(body.K + 1),
    )


@pytest.mark.parametrize("rate", [30.0, 24.0, 12.0])
def test_each_frame_gets_the_pose_of_its_own_time(body, rate):
    poses = at_frames([pose_given(body, k, k / rate, 1 / 30) for k in range(20)], 1 / 30)
    assert 17 <= len(poses) < 20
    for k, pose in enumerate(poses):
        assert (pose.index, pose.keypoints[0, 0]) == (k, k)
        assert pose.root_cam[0] == pytest.approx(k / rate, abs=1e-6)
        assert np.allclose(pose.rotations[0], rotations.exp([0.0, 0.0, 2.0 * k / rate]), atol=1e-6)


def test_soles_stay_at_their_height_in_the_last_shape(body):
    tall = np.zeros(body.P)
    tall[0] = 1.5
    poses = in_last_shape(
        [pose_given(body, 0, 0.0, 0.0), pose_given(body, 1, 0.1, 0.0, tall)], body
    )
    assert all(np.array_equal(pose.betas, tall) for pose in poses)

    def height(pose, betas, root_cam):
        model = with_contact_points(body, betas)
        R, t = model.forward_kinematics(
            pose.rotations, root_cam - model.rest_joints(betas)[0], betas
        )
        return (contact_point_positions(model, R, t)[:4] @ pose.T_world_camera[2, :3]).min()

    given = pose_given(body, 0, 0.0, 0.0)
    for name in ("root_cam", "raw_root_cam"):
        before = height(given, np.zeros(body.P), getattr(given, name))
        assert height(poses[0], tall, getattr(poses[0], name)) == pytest.approx(before, abs=1e-6)


def recorded(body, frames, fps=30, unseen=()):
    """A motion of frames, numbers and times, of a source that says it has ``fps``."""
    source = SimpleNamespace(name="fake", fps=Fraction(fps), speed=1.0)
    recording = Recording(Path("a.npz"), body, source)
    camera = Camera(pinhole(640, 480, 600.0), np.zeros(5), "given")
    recording.begin(SimpleNamespace(camera=camera), (640, 480))
    for index, time_s in frames:
        pose = pose_given(body, index, time_s, 0.06)
        presence = Presence.LOST if index in unseen else Presence.SEEN
        recording.send(replace(pose, presence=presence), 0.0)
    return recording.result()


def test_only_frames_in_which_nobody_was_seen_are_not_valid(body):
    """Every second frame of a fast camera was processed."""
    frames = [(2 * k, 2 * k / 60) for k in range(30)]
    motion = recorded(body, frames, 60, unseen=(0, 20, 22))
    assert list(motion.frames) == list(range(2, 2 * len(motion) + 2, 2))
    assert list(motion.frames[~motion.valid]) == [20, 22]
    np.testing.assert_allclose(motion.timestamps, motion.frames / 60)


@pytest.mark.parametrize(("rate", "kept"), [(15.1, 15.1), (29.4, 30.0), (60.3, 60.0)])
def test_the_frame_rate_is_that_of_the_frames_that_came(body, rate, kept):
    """In the dark, many cameras deliver half of what they say."""
    motion = recorded(body, [(2 * k, 2 * k / rate) for k in range(45)])
    assert motion.mocap_framerate == pytest.approx(kept)


@pytest.mark.parametrize(("burst", "interrupted_s"), [(4, 0.0), (7, 2.0)])
def test_frames_that_come_in_bursts_do_not_raise_the_frame_rate(body, burst, interrupted_s):
    """As those of network cameras do: most of them right after the one before."""
    frames = []
    for k in range(160):
        time_s = k // burst * burst / 30 + k % burst * 0.002
        frames.append((k, time_s + (interrupted_s if k >= 84 else 0.0)))
    assert recorded(body, frames, 60).mocap_framerate == 30


def test_a_short_recording_has_the_frame_rate_that_its_source_says(body):
    motion = recorded(body, [(k, k // 4 * 4 / 30 + k % 4 * 0.002) for k in range(20)], 25)
    assert motion.mocap_framerate == 25


def test_after_an_interruption_another_scene_begins(body):
    frames = [(k, k / 30 + (2.0 if k >= 15 else 0.0)) for k in range(30)]
    motion = recorded(body, frames)
    assert motion.valid.all()
    assert list(motion.frames[motion.scene_starts]) == [15]
