# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of the first second of the sample clip: causal, calm, and close to the offline
capture.
"""

from dataclasses import replace
from fractions import Fraction
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.media.frame import Frame
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.capture.tracking.tracker import PeopleTracker
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.live.people import LivePeople
from scope.scope_addon.live.pose import Presence
from scope.scope_addon.live.recording import Recording
from scope.scope_addon.live.session import HOLD_S
from scope.scope_addon.motion import Motion

LATE = 2  # frames of the delay of 60 ms
LEAD = 12  # frames until the filters know how the body moves
# a second and a bit, and frames without a person after them, a tenth of a second apart
FRAMES = 36
EMPTY = 8


@pytest.fixture(scope="module")
def frames():
    with open_video(SAMPLE) as video:
        seen = list(islice(video, FRAMES))
    grey = np.full_like(seen[0].image_rgb, 128)
    return seen + [Frame(FRAMES + k, FRAMES / 30 + k / 10, grey) for k in range(EMPTY)]


def people_of(body, frames):
    height, width = frames[0].image_rgb.shape[:2]
    return LivePeople(body, PeopleTracker("fast", 1), choose_camera(width, height), (width, height))


@pytest.fixture(scope="module")
def live(body, networks, frames):
    people = people_of(body, frames)
    return people, [people.step(frame)[0] for frame in frames]


@pytest.fixture(scope="module")
def recorded(body, live, frames, tmp_path_factory):
    people, poses = live
    path = tmp_path_factory.mktemp("live") / "live.npz"
    recording = Recording(
        path, body, SimpleNamespace(name="sample.mp4", fps=Fraction(30), speed=1.0)
    )
    height, width = frames[0].image_rgb.shape[:2]
    recording.begin(people.sessions[0], (width, height))
    for pose in [*poses[:20], *poses[22:]]:  # two frames were dropped
        recording.send(pose, 0.0)
    recording.result().save(path)
    return Motion.load(path)


def world_joints(motion):
    T = motion.world_from_camera
    return np.einsum("tij,tkj->tki", T[:, :3, :3], motion.joints_cam) + T[:, None, :3, 3]


def jerk(joints):
    return np.linalg.norm(np.diff(joints[LEAD:], 3, axis=0), axis=-1).mean()


@pytest.mark.slow
def test_the_recording_is_close_to_the_offline_capture(body, recorded):
    (offline,) = capture(
        SAMPLE,
        body,
        CaptureOptions(quality="fast", threads=1, wanted=VideoRange(end_s=(FRAMES - 1) / 30)),
    ).motions
    # the last poses would have been given later
    assert list(recorded.frames) == [*range(20), *range(22, FRAMES - LATE)]
    relative = [
        m.joints_cam[rows] - m.joints_cam[rows, :1]
        for m, rows in ((recorded, slice(None)), (offline, recorded.frames))
    ]
    assert np.median(np.linalg.norm(relative[0] - relative[1], axis=-1)) < 0.025
    assert jerk(relative[0]) < 1.5 * jerk(relative[1])
    assert jerk(world_joints(recorded)) < 1.5 * jerk(world_joints(offline)[recorded.frames])


def test_feet_stand_on_the_floor_and_the_world_does_not_jump(live):
    poses = live[1][:FRAMES]
    feet = np.array([pose.joints[[10, 11], 2] for pose in poses])
    # the joints of toes are some centimetres above their soles
    assert np.abs(np.median(feet)) < 0.12
    camera = np.array([pose.T_world_camera[:3, 3] for pose in poses])
    assert np.linalg.norm(np.diff(camera, axis=0), axis=1).max() < 0.05


def test_without_a_person_the_pose_is_held_and_then_lost(live):
    last = live[1][FRAMES - 1]
    rest = live[1][FRAMES + 2 :]
    assert last.presence is Presence.SEEN
    for pose in rest:
        elapsed_s = pose.timestamp_s - last.timestamp_s
        assert pose.presence is (Presence.HELD if elapsed_s <= HOLD_S else Presence.LOST)
        assert not pose.contact.any()
    assert np.array_equal(rest[0].rotations, rest[-1].rotations)
    assert rest[-1].presence is Presence.LOST


def test_time_in_which_nobody_is_seen_does_not_count(live, frames):
    """The estimates of a moment would be final after it."""
    session = live[0].sessions[0]
    empty = frames[-1]
    for k in range(1, 11):
        later = replace(empty, timestamp_s=empty.timestamp_s + k / 2)
        assert not session.step(later, None).is_settled
