# SPDX-License-Identifier: GPL-3.0-or-later
"""Hands in real footage, and with fake networks: lost and found, of another person, of both sides
at once.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.perception.hand_landmarks import pixels_per_metre
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.capture.tracking import hand_tracker
from scope.scope_addon.capture.tracking.hand_tracker import HandTracker
from scope.solver.body_file import load_body
from scope.solver.rotations import exp

from ...followed_people import FollowedPeople
from .flat_hand import LENGTH, SCALE, hand_at

IMAGE = np.zeros((1000, 1000, 3), np.uint8)


def person(left_wrist=(300, 500), right_wrist=(700, 500)):
    world = np.zeros((33, 3))
    world[:, :2] = np.random.default_rng(0).standard_normal((33, 2)) * 0.4
    for side, wrist in (("left", left_wrist), ("right", right_wrist)):
        for name, up in (("elbow", -0.25), ("wrist", 0.0), ("index", 0.09), ("pinky", 0.09)):
            at = KEYPOINT_NAMES.index(f"{side}_{name}")
            world[at, :2] = (np.array(wrist) - 500) / SCALE - [0, up]
    pixels = world[:, :2] * SCALE + 500
    assert pixels_per_metre(pixels, world) == pytest.approx(SCALE)
    return Observation(pixels, np.ones(33), world, 1.0, Region((500.0, 500.0), 900.0, 0.0), False)


class FakeHands:
    """Sees only the hand whose centre is nearest to the region's, if it is inside."""

    def __init__(self, hands):
        self.hands = hands
        self.calls = 0

    def estimate(self, _image, region):
        self.calls += 1
        inside = [
            h
            for h in self.hands
            if np.hypot(*(h.keypoints_px[9] - region.center_px)) < region.side_px / 3
        ]
        if not inside:
            return hand_at(region.center_px, presence=0.0)
        return min(inside, key=lambda h: np.hypot(*(h.keypoints_px[9] - region.center_px)))


class FakePalms:
    def __init__(self, hands):
        self.hands = hands
        self.calls = 0

    def detect(self, _image, where, threshold):
        self.calls += 1
        near = [
            h
            for h in self.hands
            if np.hypot(*(h.keypoints_px[9] - where.center_px)) < where.side_px / 2
        ]
        return [h.region for h in near]


@pytest.fixture
def follow(monkeypatch):
    """``follow(hands)``: a tracker whose networks see these hands, as long as they are in the
    list.
    """

    def make(hands, **options):
        monkeypatch.setattr(hand_tracker, "HandNetwork", lambda *_: FakeHands(hands))
        monkeypatch.setattr(hand_tracker, "PalmDetector", lambda *_: FakePalms(hands))
        return HandTracker(1, **options)

    return make


def seen(tracker, observation):
    (_, found), *_ = tracker.step(IMAGE, [(0, observation)])
    return found.hands[:, 0, 2] > 0


def test_each_hand_goes_to_its_own_side_and_then_needs_one_call_per_frame(follow):
    left = hand_at((300, 500))
    right = hand_at((700, 500), left=0.05)
    tracker = follow([left, right])
    (_, found), *_ = tracker.step(IMAGE, [(0, person())])
    assert np.array_equal(found.hands[0, :, :2], left.keypoints_px.astype(np.float32))
    assert np.array_equal(found.hands[1, :, :2], right.keypoints_px.astype(np.float32))
    palms = tracker._palms.calls
    calls = tracker._network.calls
    assert seen(tracker, person()).all()
    assert tracker._palms.calls == palms
    assert tracker._network.calls == calls + 2


def test_a_hand_is_found_again_and_zeros_mark_the_frames_without_it(follow):
    hands = [hand_at((300, 500))]
    tracker = follow(hands)
    assert list(seen(tracker, person())) == [True, False]
    gone = hands.pop()
    (_, found), *_ = tracker.step(IMAGE, [(0, person())])
    assert not found.hands.any()
    for _ in range(30):
        assert not seen(tracker, person()).any()
    hands.append(gone)
    assert any(seen(tracker, person())[0] for _ in range(4))


@pytest.mark.parametrize("rate", [12, 60])
def test_a_missing_hand_is_searched_equally_often_at_any_frame_rate(follow, rate):
    """Each hand for a third of a second in every frame, or 30 times per second, then six to eight
    times per second.
    """
    tracker = follow([])
    calls = []
    for k in range(3 * rate):
        tracker.step(IMAGE, [(0, person())], k / rate)
        calls.append(tracker._palms.calls)
    assert calls[rate // 3] == 2 * 2 * (min(rate, 30) // 3 + 1)  # with a second look each time
    assert 22 <= calls[3 * rate - 1] - calls[rate - 1] <= 32  # in two seconds, both hands


def test_a_hand_is_followed_with_the_wrist_where_it_moves_far_in_a_frame(follow):
    hands = [hand_at((300, 500))]
    tracker = follow(hands)
    tracker.step(IMAGE, [(0, person())])
    hands[0] = hand_at((300 + 2 * LENGTH, 500))
    palms = tracker._palms.calls
    (_, found), *_ = tracker.step(IMAGE, [(0, person(left_wrist=(300 + 2 * LENGTH, 500)))])
    assert np.array_equal(found.hands[0, :, :2], hands[0].keypoints_px.astype(np.float32))
    assert tracker._palms.calls == palms + 2  # both of the right hand, which is not there


def test_a_hand_that_the_network_is_unsure_of_is_reported_as_tentative_and_followed(follow):
    hands = [hand_at((300, 500))]
    tracker = follow(hands)
    tracker.step(IMAGE, [(0, person())])
    hands[0] = hand_at((300, 500), presence=0.3)
    for _ in range(15):
        (_, found), *_ = tracker.step(IMAGE, [(0, person())])
        assert (found.hands[0, :, 2] == -0.3).all()
        assert np.array_equal(found.hands[0, :, :2], hands[0].keypoints_px.astype(np.float32))
    hands[0] = hand_at((300, 500), presence=0.1)
    (_, found), *_ = tracker.step(IMAGE, [(0, person())])
    assert not found.hands.any()


def test_a_hand_of_another_colour_than_before_is_imagined_unless_it_is_certain(follow):
    skin, cloth = (
        np.full((1000, 1000, 3), color, np.uint8) for color in ((134, 104, 79), (26, 40, 45))
    )
    hands = [hand_at((300, 500), presence=0.9)]
    tracker = follow(hands)
    for image, presence, is_seen in (
        (skin, 0.9, True),
        (cloth, 0.9, False),
        (skin, 0.9, True),
        (cloth, 0.97, True),
    ):
        hands[0] = hand_at((300, 500), presence=presence)
        (_, found), *_ = tracker.step(image, [(0, person())])
        assert (found.hands[0, 0, 2] > 0) == is_seen
        assert is_seen or not found.hands[0].any()


@pytest.mark.parametrize(("away", "is_seen"), [(0.2, True), (0.4, False)])
def test_a_second_look_finds_a_hand_by_an_unsure_palm_but_only_at_the_bodys_wrist(
    follow, away, is_seen
):
    class InPalms(FakeHands):
        def estimate(self, image, region):
            of_body = min(abs(region.side_px / LENGTH - scale) for scale in (1.5, 0.7 * 1.5)) < 0.01
            return (
                hand_at(region.center_px, presence=0.0)
                if of_body
                else super().estimate(image, region)
            )

    class UnsurePalms(FakePalms):
        def detect(self, image, where, threshold):
            return super().detect(image, where, threshold) if threshold < 0.5 else []

    hands = [hand_at((300 + away * LENGTH, 500), presence=0.7)]
    tracker = follow(hands)
    tracker._network = InPalms(hands)
    tracker._palms = UnsurePalms(hands)
    assert seen(tracker, person())[0] == is_seen


def test_a_hand_beyond_the_forearms_reach_is_not_that_arms(follow):
    """The left elbow is three hands away: the left hand there is somebody else's."""
    here = (500, 500)
    there = (500 + 1.8 * LENGTH, 500)
    tracker = follow([hand_at(there, left=0.97)])
    person_ = person(left_wrist=here, right_wrist=there)
    elbow = KEYPOINT_NAMES.index("left_elbow")
    person_.keypoints_px[elbow] = (500 - 1.3 * LENGTH, 500)
    assert not seen(tracker, person_).any()


def test_one_hand_is_not_assigned_to_both_sides(follow):
    tracker = follow([hand_at((500, 500), left=0.5)])
    assert list(seen(tracker, person(left_wrist=(495, 500), right_wrist=(540, 500)))) == [
        True,
        False,
    ]


def numbered_pixels():
    """An image in which each pixel says where it is."""
    y, x = np.mgrid[:1000, :1000]
    return np.stack([x % 256, y % 256, 16 * (x // 256) + y // 256], axis=2).astype(np.uint8)


class InFrame(FakeHands):
    """Knows from the pixels which part of the frame it is given."""

    def estimate(self, image, region):
        x, y, both = (int(value) for value in image[0, 0])
        offset = np.array([x + 256 * (both // 16), y + 256 * (both % 16)])
        found = super().estimate(image, region.moved(offset))
        return replace(found, keypoints_px=found.keypoints_px - offset)


def test_a_hand_that_is_found_again_is_followed_back_through_the_frames_in_which_it_was_missed(
    follow,
):
    """For a third of a second, and in the arrays that were given out for these frames.

    It is near the edge, so that less than a square around the wrist is kept of a frame.
    """
    hands = []
    people = FollowedPeople()
    first = None
    tracker = follow(hands)
    tracker._network = InFrame(hands)
    image = numbered_pixels()
    for k in range(25):
        if k == 20:
            hands.append(hand_at((30, 120)))
        observations = tracker.step(image, [(0, person(left_wrist=(30, 120)))], k / 30)
        if observations[0][1].hands.any() and first is None:
            first = k
        people.add(k / 30, observations)
    assert first >= 20
    (track,) = people.tracks(1)
    assert list(np.flatnonzero(track.hands[:, 0, 0, 2] > 0)) == list(range(first - 10, 25))
    for row in track.hands[first - 10 :, 0]:
        np.testing.assert_allclose(row[:, :2], hands[0].keypoints_px, atol=1e-3)
    assert not track.hands[:, 1].any()


@pytest.mark.slow
def test_a_capture_with_hands_from_file_to_motion(shared):
    """Fingers are near the keypoints in the image, and all arrays of the motion are consistent."""
    body = load_body("scope_h")
    wanted = VideoRange(1.4, 2.0, None)
    options = CaptureOptions(quality="fast", hands="on", threads=1, smoothing=False, wanted=wanted)
    result = capture(shared / "data/clips/gesture_square.mp4", body, options)
    m = result.motions[0]
    assert m.body_model == "scope_h"
    assert m.keypoints2d.shape[1] == len(m.keypoints2d_names) == 33 + 42
    for side in ("left", "right"):
        assert result.report.per_person[0][f"{side}_hand_frames"] > 0.8 * len(m)
    index = [body.keypoint_names.index(str(name)) for name in m.keypoints2d_names[33:]]
    R, t = body.forward_kinematics(
        exp(m.poses.reshape(len(m), -1, 3).astype(float)), m.trans.astype(float), m.betas
    )
    points = body.keypoints(R, t, m.betas.astype(float))[:, index]
    camera_from_world = np.linalg.inv(m.world_from_camera)
    points = (
        np.einsum("tij,tkj->tki", camera_from_world[:, :3, :3], points)
        + camera_from_world[:, None, :3, 3]
    )
    pixels = points[..., :2] / points[..., 2:] * m.intrinsics[0, 0] + m.intrinsics[:2, 2]
    off = np.linalg.norm(pixels - m.keypoints2d[:, 33:, :2], axis=-1)[m.keypoints2d[:, 33:, 2] > 0]
    assert np.median(off) < 3.5  # pixels; a palm measures 13 of them
    finger = body.joint_names.index("left_index2")
    assert np.array_equal(m.joint_confidence[:, finger] > 0, m.keypoints2d[:, 33, 2] > 0)


@pytest.mark.slow
def test_auto_captures_large_hands_and_leaves_the_fingers_of_small_ones_at_rest(shared):
    """Hands of 37 pixels from wrist to middle knuckle in the first clip, of 13 in the second."""
    body = load_body("scope_h")
    options = CaptureOptions(quality="fast", hands="auto", threads=1, smoothing=False)
    clips = {
        "squats_5fps": VideoRange(0.0, 1.0, None),
        "gesture_square": VideoRange(1.4, 1.6, None),
    }
    large, small = (
        capture(shared / f"data/clips/{name}.mp4", body, replace(options, wanted=wanted))
        for name, wanted in clips.items()
    )
    assert large.report.per_person[0]["right_hand_frames"] == len(large.motions[0])
    assert small.report.per_person[0]["right_hand_frames"] == 0
    assert not any("hands" in warning for warning in map(str, small.report.warnings))
    fingers = [
        body.joint_names.index(f"right_{name}{k}")
        for name in ("index", "middle")
        for k in (1, 2, 3)
    ]
    rotations = small.motions[0].poses.reshape(len(small.motions[0]), -1, 3)[:, fingers]
    np.testing.assert_allclose(rotations, 0.0, atol=1e-6)
