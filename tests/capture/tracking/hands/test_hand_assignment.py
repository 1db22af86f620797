# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose hand it is: places, sizes and sides that fit a body, and one hand that was found twice.

Which tentative hands are believed: those that continue a sure one, for a short time, in both
directions.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.perception.hand_landmarks import WRISTS, HandEstimate
from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.hand_assignment import (
    CERTAIN_PRESENCE,
    MAX_SIZE,
    PREDICTED,
    SECOND,
    SUPPORT_S,
    assigned,
    confirmed,
    is_same_hand,
)
from scope.scope_addon.capture.tracking.hand_sight import Found
from scope.scope_addon.capture.tracking.left_right import swap_keypoints
from scope.scope_addon.capture.tracking.track import Track

from .flat_hand import LENGTH, SCALE, SHAPE, hand_at

WRIST_PX = {0: (300.0, 500.0), 1: (700.0, 500.0)}


def hand(side: int, away: float = 0.0, left: float | None = None, **given: float) -> HandEstimate:
    """Return the hand at a wrist, or some hand lengths beside it."""
    x, y = WRIST_PX[side]
    left = (0.95 if side == 0 else 0.05) if left is None else left
    return hand_at((x + away * LENGTH, y), left, **{"presence": 0.9, **given})


def person(sure: float = 1.0, right_wrist_px: tuple[float, float] = WRIST_PX[1]) -> Observation:
    points = np.zeros((33, 2))
    confidence = np.ones(33)
    points[WRISTS[0]] = WRIST_PX[0]
    points[WRISTS[1]] = right_wrist_px
    confidence[WRISTS] = sure
    return Observation(
        points, confidence, np.zeros((33, 3)), 1.0, Region((500.0, 500.0), 900.0, 0.0), False
    )


@pytest.mark.parametrize("side", [0, 1])
def test_a_hand_at_its_wrist_is_this_one(side: int) -> None:
    found = hand(side)
    assert assigned(found, person(), SCALE, side) is found
    assert assigned(found, person(), SCALE, 1 - side) is None


def test_a_hand_beside_the_wrist_is_this_one_only_as_far_as_the_wrist_is_unsure() -> None:
    for away, is_sure, is_unsure in ((0.6, True, True), (0.9, False, True), (1.4, False, False)):
        found = hand(0, away=away)
        assert (assigned(found, person(), SCALE, 0) is not None) == is_sure
        assert (assigned(found, person(sure=0.3), SCALE, 0) is not None) == is_unsure


def test_a_hand_has_a_size_that_fits_the_body() -> None:
    sizes = {
        size: assigned(hand(0, size=size), person(), SCALE, 0) is not None
        for size in (0.2, 0.3, 1.9, 2.1)
    }
    assert sizes == {0.2: False, 0.3: True, 1.9: True, 2.1: False}
    assert MAX_SIZE == 2.0
    # a second look finds small ones in skin
    assert assigned(hand(0, size=0.3), person(), SCALE, 0, SECOND) is None


def test_more_presence_is_required_elsewhere_than_at_the_wrist() -> None:
    for presence, away, is_found in (
        (0.7, 0.0, True),
        (0.7, 0.5, False),
        (0.85, 0.5, True),
        (0.5, 0.0, False),
    ):
        found = assigned(hand(0, away=away, presence=presence), person(), SCALE, 0, PREDICTED)
        assert (found is not None) == is_found
    assert assigned(hand(0, presence=np.nan), person(), SCALE, 0) is None


def test_an_imagined_hand_contradicts_itself() -> None:
    found = hand(0)
    odd = replace(found, world_landmarks=found.world_landmarks[::-1] * [1.0, -1.0, 1.0])
    assert odd.disagreement > 0.3 > found.disagreement
    assert assigned(odd, person(), SCALE, 0) is None
    assert assigned(replace(odd, presence=CERTAIN_PRESENCE), person(), SCALE, 0) is not None


def test_a_hand_of_the_wrong_side_at_this_wrist_alone_is_mirrored_in_depth() -> None:
    """A left hand looks like a right one with reversed depth."""
    found = hand(0, left=0.05)
    mirrored = assigned(found, person(), SCALE, 0)
    assert mirrored is not None
    np.testing.assert_array_equal(mirrored.world_landmarks, found.world_landmarks * [1, 1, -1])
    np.testing.assert_array_equal(mirrored.keypoints_px, found.keypoints_px)
    assert mirrored.left == pytest.approx(0.95)
    assert assigned(hand(0, left=0.05, away=0.4), person(), SCALE, 0) is None
    assert assigned(hand(0, left=0.05, away=0.4), person(), SCALE, 0, same_wrist=0.5) is not None
    near = WRIST_PX[0][0] + 0.8 * LENGTH, WRIST_PX[0][1]
    # it may be the other hand
    assert assigned(found, person(right_wrist_px=near), SCALE, 0) is None
    assert assigned(found, person(sure=0.3), SCALE, 0) is None


@pytest.mark.parametrize(
    ("left", "is_sure"), [(0.02, True), (0.02, False), (0.3, True), (0.7, True)]
)
def test_a_hand_has_its_own_depth_again_where_left_and_right_are_exchanged_back(
    left: float, *, is_sure: bool
) -> None:
    """A right hand, sure or not, at what the body's network took for the left wrist."""
    found = hand(0, left=left)
    at_left = assigned(found, person(), SCALE, 0)
    assert at_left is not None
    rows = np.zeros((2, 2, 21, 7), np.float32)
    rows[0, 0] = Found(at_left, is_sure, None).row
    rows[1, 0] = rows[0, 0]
    track = Track(
        frames=np.arange(2),
        times=np.arange(2) / 30,
        seen=np.ones(2, bool),
        keypoints_px=np.zeros((2, 33, 2), np.float32),
        confidence=np.ones((2, 33), np.float32),
        world_landmarks=np.zeros((2, 33, 3), np.float32),
        acquired=np.arange(2) == 0,
        hands=rows,
    )
    where = np.array([True, False])
    exchanged = swap_keypoints(track, where).hands
    assert exchanged is not None
    # As if the wrist had been the right one from the start: the same but for where it is.
    at_right = assigned(hand(1, left=left), person(), SCALE, 1)
    assert at_right is not None
    np.testing.assert_allclose(exchanged[0, 1, :, 3:6], at_right.world_landmarks, atol=1e-7)
    assert exchanged[0, 1, 0, 6] == pytest.approx(at_right.left)
    assert not exchanged[0, 0].any()
    np.testing.assert_array_equal(exchanged[1], rows[1])
    again = swap_keypoints(replace(track, hands=exchanged), where).hands
    assert again is not None
    np.testing.assert_allclose(again, rows, atol=1e-7)


def test_hands_that_touch_are_two_where_the_network_is_sure_of_their_sides() -> None:
    a = hand(0, left=0.95)
    for left, away, is_same in (
        (0.5, 0.2, True),
        (0.05, 0.2, False),
        (0.05, 0.1, True),
        (0.5, 0.5, False),
    ):
        assert is_same_hand(a, hand(0, left=left, away=away)) == is_same
    assert not is_same_hand(a, None)


FPS = 30


LEFT = 0


def tentative_hand(presence, turned_deg=0.0, size=40.0):
    """A flat hand of 21 points, as in a row of the track; a negative presence marks it as
    tentative.
    """
    a = np.radians(turned_deg)
    out = np.zeros((21, 7))
    out[:, :2] = size * SHAPE @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) + 300.0
    out[:, 2] = presence
    out[:, 3:5] = SHAPE
    return out


def track(presences):
    """Hands (T, 2, 21, 7) of which the left one has these presences."""
    hands = np.zeros((len(presences), 2, 21, 7))
    for k, presence in enumerate(presences):
        if presence:
            hands[k, LEFT] = tentative_hand(presence)
    return hands


def believed(hands, fps=FPS):
    return list(np.flatnonzero(confirmed(hands, np.arange(len(hands)) / fps)[:, LEFT, 0, 2] > 0))


def test_sure_hands_stay_and_lone_tentative_ones_go():
    hands = track([0.9, 0, 0, 0, 0, 0, 0, -0.4, 0, 0, 0, 0, 0, 0.8])
    found = confirmed(hands, np.arange(len(hands)) / FPS)
    np.testing.assert_array_equal(found[[0, 13]], hands[[0, 13]])
    assert not found[1:13].any()


def test_tentative_hands_beside_sure_ones_are_believed_with_their_low_confidence():
    found = confirmed(track([-0.3, 0.9, -0.4, -0.25, 0.9]), np.arange(5) / FPS)
    np.testing.assert_allclose(found[:, LEFT, 0, 2], [0.3, 0.9, 0.4, 0.25, 0.9])
    assert not found[:, 1].any()


@pytest.mark.parametrize("fps", [15, 30, 60])
def test_support_ends_after_the_same_time_at_every_rate(fps):
    hands = track([0.9] + [-0.4] * (2 * fps))
    assert len(believed(hands, fps)) == int(SUPPORT_S * fps + 1e-6) + 1
    assert len(believed(hands[::-1], fps)) == int(SUPPORT_S * fps + 1e-6) + 1


def test_a_tentative_hand_of_another_shape_is_not_believed():
    hands = track([0.9, -0.4, -0.4, -0.4])
    hands[1, LEFT] = tentative_hand(-0.4, turned_deg=120)
    assert believed(hands) == [0, 2, 3]
    hands = track([0.9, -0.4])
    hands[1, LEFT] = tentative_hand(-0.4, size=90.0)
    assert believed(hands) == [0]
