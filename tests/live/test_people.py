# SPDX-License-Identifier: GPL-3.0-or-later
"""Several people: each keeps their session, also after they were away, and all stand in one
world.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.media.frame import Frame
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.appearance import SIZE
from scope.scope_addon.capture.tracking.tracker import PeopleTracker
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.live import people as module
from scope.scope_addon.live.people import LivePeople
from scope.scope_addon.live.pose import Presence
from scope.scope_addon.live.recording import PeopleRecording
from scope.scope_addon.motion import Motion

from .test_vmc import pose_of

FRAMES = 10
GREY = np.full((8, 8, 3), 128, np.uint8)


def person(x_px, clothes, side_px=300.0):
    """Somebody at a place in the image, in clothes of one colour."""
    keypoints = np.full((33, 2), 400.0) + [x_px - 400.0, 0.0]
    colour = np.zeros((2, SIZE // 2))
    colour[:, clothes] = 1.0
    return Observation(
        keypoints,
        np.ones(33),
        np.ones((33, 3)),
        1.0,
        Region((x_px, 400.0), side_px, 0.0),
        False,
        colour.ravel(),
    )


@pytest.fixture
def followed(body, monkeypatch):
    """Return a function that follows people, two unless told, through a scripted clip: whom each
    session follows by frame, or with ``acquired``, in which frames it was told of somebody new.
    """

    class Session:
        def __init__(self, *_):
            self.seen = []
            self.acquired = []

        def step(self, frame, observation):
            self.seen.append(None if observation is None else observation.region.center_px[0])
            self.acquired.append(observation is not None and observation.acquired)
            return pose_of(body)

    def run(*frames, every_s=0.1, count=2, acquired=False):
        monkeypatch.setattr(module, "LiveSession", Session)
        script = iter(frames)
        tracker = SimpleNamespace(step=lambda *_: list(next(script).items()))
        people = LivePeople(body, tracker, None, (800, 800), count=count)
        for k in range(len(frames)):
            poses = people.step(Frame(k, every_s * k, GREY))
            assert [pose.person for pose in poses] == list(range(count))
        return [session.acquired if acquired else session.seen for session in people.sessions]

    return run


def test_the_largest_person_gets_the_first_session_and_a_third_one_none(followed):
    a = person(100, 0, 200.0)
    b = person(300, 1, 300.0)
    c = person(500, 2, 100.0)
    assert followed({4: a, 7: b, 9: c}, {9: c, 7: b, 4: a}) == [[300, 300], [100, 100]]


def test_a_stranger_gets_a_session_only_when_its_person_has_been_away_for_long(followed):
    a = person(100, 0)
    b = person(500, 1, 290.0)
    seen = followed({0: a, 1: b}, {0: a}, {0: a, 5: person(700, 3)})
    assert seen[1] == [500, None, None]
    seen = followed({0: a, 1: b}, *[{0: a}] * 40, {0: a, 5: person(700, 3)})
    assert seen[1][-1] == 700


def test_a_stranger_in_other_clothes_is_not_who_left_there_in_frames_without_clothes(followed):
    """The tracker looks at the clothes in every fourth frame only."""
    a = person(100, 0)
    stranger = person(510, 3)
    unlooked = replace(stranger, appearance=None)
    frames = [{0: a, 1: person(500, 1, 290.0)}, *[{0: a}] * 4]
    frames += [{0: a, 5: stranger}, *[{0: a, 5: unlooked}] * 3] * 2
    assert followed(*frames)[1] == [500, *[None] * 12]


def test_who_returns_is_known_as_soon_as_the_clothes_are_seen_well(followed):
    a = person(100, 0)
    mixed = person(500, 3)
    back = person(500, 1)
    unlooked = replace(back, appearance=None)
    frames = [{0: a, 1: person(500, 1, 290.0)}, *[{0: a}] * 4]
    frames += [{0: a, 5: mixed}, {0: a, 5: unlooked}, *[{0: a, 5: back}] * 2]
    seen = followed(*frames)[1]
    assert seen[:7] == [500, *[None] * 6]
    assert seen[-1] == 500


def test_of_two_people_who_left_each_gets_their_session_back_by_clothes(followed):
    """They come back elsewhere, a little before two seconds have passed, which is too far for a
    walk.
    """
    frames = [{0: person(100, 0), 1: person(500, 1, 290.0)}, *[{}] * 18]
    frames += [{5: person(2100, 1), 6: person(2500, 0, 250.0)}] * 4
    assert [seen[-1] for seen in followed(*frames)] == [2500, 2100]


def test_a_bystander_who_was_seen_beside_somebody_is_never_that_person(followed):
    """Not even in the same clothes, a step away."""
    a = person(100, 0)
    b = person(500, 1, 290.0)
    bystander = person(560, 1, 250.0)
    seen = followed({0: a, 1: b, 5: bystander}, *[{0: a, 5: bystander}] * 22)
    assert seen[1] == [500, *[None] * 20, 560, 560]


def test_a_session_is_told_that_somebody_it_has_not_followed_is_new(followed):
    """The tracker has followed them for a while, and says so."""
    a = person(100, 0)
    b = person(500, 1, 290.0)
    gap = {}
    script = ({0: a, 1: b}, {0: a, 1: b}, {1: b}, {1: b}, gap, {1: b}, {0: a})
    (told,) = followed(*script, count=1, acquired=True)
    assert told == [True, False, True, False, False, False, True]
    bystander = person(560, 1, 250.0)
    told = followed({0: a, 1: b, 5: bystander}, *[{0: a, 5: bystander}] * 22, acquired=True)
    assert told[1] == [True, *[False] * 20, True, False]


@pytest.fixture(scope="module")
def beside(body, networks):
    """People and poses of the sample clip beside itself."""
    with open_video(SAMPLE) as video:
        frames = [
            Frame(f.index, f.timestamp_s, np.hstack([f.image_rgb] * 2))
            for f in islice(video, FRAMES)
        ]
    height, width = frames[0].image_rgb.shape[:2]
    camera = choose_camera(width, height, fov_deg=85.0)
    people = LivePeople(body, PeopleTracker("fast", 1, 2), camera, (width, height), count=2)
    return people, [people.step(frame) for frame in frames], (width, height)


def test_both_are_seen_in_one_world(beside):
    people, steps, _ = beside
    for poses in steps:
        assert [pose.presence for pose in poses] == [Presence.SEEN] * 2
        assert np.array_equal(poses[0].T_world_camera, poses[1].T_world_camera)
    assert people.sessions[0].camera is people.sessions[1].camera
    first, second = steps[-1]
    apart = second.joints[0] - first.joints[0]
    assert 1.0 < np.hypot(*apart[:2]) < 4.0
    for pose in (first, second):
        assert abs(pose.joints[[10, 11], 2].min()) < 0.1  # toes on the floor
    relative = [pose.joints - pose.joints[0] for pose in (first, second)]
    # seen from two sides
    assert np.median(np.linalg.norm(relative[0] - relative[1], axis=1)) < 0.15


def test_the_recordings_begin_together(beside, body, tmp_path):
    people, steps, size = beside
    source = SimpleNamespace(name="two", fps=30, speed=1.0)
    paths = [tmp_path / "a.npz", tmp_path / "b.npz"]
    recording = PeopleRecording(paths, body, source, origin=(0, 0.0))
    recording.begin(people, size)
    for k, poses in enumerate(steps):
        for pose in poses[: 1 if k < 4 else 2]:  # the second one comes later
            recording.send(pose, 0.0)
    assert recording.save() == paths
    first, second = map(Motion.load, paths)
    assert (first.frames[0], second.frames[0]) == (0, 4)
    assert np.array_equal(first.world_from_camera[-1], second.world_from_camera[-1])


def test_who_was_never_seen_has_no_file(beside, body, tmp_path):
    people, steps, size = beside
    recording = PeopleRecording(
        [tmp_path / "a.npz", tmp_path / "b.npz"],
        body,
        SimpleNamespace(name="two", fps=30, speed=1.0),
    )
    recording.begin(people, size)
    for poses in steps:
        recording.send(poses[0], 0.0)
    assert recording.save() == [tmp_path / "a.npz"]
