# SPDX-License-Identifier: GPL-3.0-or-later
"""What holds once the estimates of the first seconds are reached: the sample clip there and back,
ten seconds.

The networks look at every second frame of the clip once; the way back is what they found, in
reverse.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.media.frame import Frame
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.tracking.tracker import PeopleTracker
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.live.people import LivePeople
from scope.scope_addon.live.pose import Presence
from scope.scope_addon.live.session import CALIBRATED_S, SETTLED_S

pytestmark = pytest.mark.slow  # the networks see 75 frames
RATE = 15.0
# frames after a foot has landed in which smoothing still shows the step: 60 ms, and the time of its
# filters
LATE = 2
SHORTEST = 4  # frames for which a foot stands


@pytest.fixture(scope="module")
def played(body, networks):
    """The poses, and the clip's frame that each of them shows."""
    with open_video(SAMPLE) as video:
        images = [frame.image_rgb for frame in video if frame.index % 2 == 0]
    tracker = PeopleTracker("fast", 1)
    order = [*range(len(images)), *range(len(images) - 2, -1, -1)]
    found = [tracker.step(image, time_s=k / RATE) for k, image in enumerate(images)]
    size = images[0].shape[1], images[0].shape[0]
    at = iter(order)
    people = LivePeople(
        body, SimpleNamespace(step=lambda *_: found[next(at)]), choose_camera(*size), size
    )
    poses = []
    focal = []
    for k, row in enumerate(order):
        poses.append(people.step(Frame(k, k / RATE, images[row]))[0])
        focal.append(people.sessions[0].camera.intrinsics[0, 0])
    at = iter([*order, *order])
    return poses, np.array(focal), 2 * np.array(order), people


def test_the_estimates_settle_when_they_are_said_to_and_stay(played):
    poses, focal, _, _ = played
    settled = np.array([pose.is_settled for pose in poses])
    first = int(settled.argmax())
    assert settled[first:].all()
    assert poses[first].timestamp_s == pytest.approx(CALIBRATED_S + SETTLED_S, abs=1.5 / RATE)
    betas = np.array([pose.betas for pose in poses[first:]])
    assert np.abs(betas - betas[-1]).max() < 0.01  # standard deviations of shapes
    assert np.ptp(focal[first:]) < 0.001 * focal[-1]
    T = np.array([pose.T_world_camera for pose in poses[first:]])
    assert np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1).max() < 0.002  # no jump
    assert np.linalg.norm(T[:, :3, 3] - T[-1, :3, 3], axis=1).max() < 0.015  # and no drift
    assert np.degrees(np.arccos(np.clip(T[:, 2, :3] @ T[-1, 2, :3], -1, 1))).max() < 0.5


def test_feet_that_stand_by_the_ground_truth_do_not_slide(played):
    poses, _, frames, _ = played
    with np.load(SAMPLE.with_name("sample_truth.npz")) as truth:
        stands = truth["standing"][frames]
    settled = np.array([pose.is_settled for pose in poses])
    joints = np.array([pose.joints for pose in poses])
    slides = []
    for side, (ankle, toe) in enumerate([(7, 10), (8, 11)]):
        foot = joints[:, [ankle, toe]].mean(axis=1)
        now = stands[:, side] & settled
        for rows in np.split(np.arange(len(now)), np.flatnonzero(np.diff(now)) + 1):
            if now[rows[0]] and len(rows) >= LATE + SHORTEST:
                shown = foot[rows[LATE:]]
                slides.append(np.linalg.norm(shown - np.median(shown, axis=0), axis=1).max())
    assert len(slides) >= 3
    assert np.mean(slides) < 0.02


def test_after_an_hour_of_sleep_the_body_is_where_it_was(body, played):
    """The clock leaps by an hour, and the first frame after it shows the same as the last one
    before.

    That frame is fitted from nothing and lifted as a still, which may take an arm for its mirror
    image in depth, and puts an ankle 10 cm farther away.
    """
    poses, _, _, people = played
    last = poses[-1]
    size = (480, 640, 3)
    awake = [
        people.step(Frame(200 + k, 3600 + (200 + k) / RATE, np.zeros(size, np.uint8)))[0]
        for k in range(12)
    ]
    assert all(pose.presence is Presence.SEEN and pose.is_settled for pose in awake)
    T = np.array([pose.T_world_camera for pose in (last, *awake)])
    assert np.abs(np.diff(T, axis=0)).max() < 0.002
    joints = np.array([pose.joints for pose in awake])
    arms = [any(part in name for part in ("elbow", "wrist", "hand")) for name in body.joint_names]
    assert np.linalg.norm(joints[0] - last.joints, axis=1)[~np.array(arms)].max() < 0.12
    # nor does it move abruptly then
    assert np.linalg.norm(np.diff(joints[:, 0], axis=0), axis=-1).max() < 0.03
    np.testing.assert_allclose(awake[-1].betas, last.betas, atol=0.01)
