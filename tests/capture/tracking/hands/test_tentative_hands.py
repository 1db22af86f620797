# SPDX-License-Identifier: GPL-3.0-or-later
"""Which tentative hands are believed: those that continue a sure one, for a short time, in both
directions.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.tracking.hands.hand_assignment import SUPPORT_S, confirmed

FPS = 30
LEFT = 0


def hand(presence, turned_deg=0.0, size=40.0, wrist=(200.0, 300.0)):
    """A flat hand of 21 points, as in a row of the track; a negative presence marks it as
    tentative.
    """
    a = np.radians(turned_deg)
    points = np.array(
        [[0.0, 0.0], *([x, y] for x in (-0.4, -0.2, 0, 0.2, 0.4) for y in (-0.5, -0.65, -0.8, -1))]
    )
    out = np.zeros((21, 6))
    out[:, :2] = size * points @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) + wrist
    out[:, 2] = presence
    out[:, 3:5] = points
    return out


def track(presences):
    """Hands (T, 2, 21, 6) of which the left one has these presences."""
    hands = np.zeros((len(presences), 2, 21, 6))
    for k, presence in enumerate(presences):
        if presence:
            hands[k, LEFT] = hand(presence)
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


def test_support_does_not_reach_over_a_gap():
    assert believed(track([0.9, 0, 0, 0, 0, 0, -0.4])) == [0]


def test_a_tentative_hand_of_another_shape_is_not_believed():
    hands = track([0.9, -0.4, -0.4, -0.4])
    hands[1, LEFT] = hand(-0.4, turned_deg=120)
    assert believed(hands) == [0, 2, 3]
    hands = track([0.9, -0.4])
    hands[1, LEFT] = hand(-0.4, size=90.0)
    assert believed(hands) == [0]


def test_a_hand_that_moves_without_turning_is_believed():
    hands = track([0.9, -0.4])
    hands[1, LEFT] = hand(-0.4, wrist=(400.0, 100.0))
    assert believed(hands) == [0, 1]


def test_the_input_stays_as_it_is():
    hands = track([0.9, -0.4])
    before = hands.copy()
    confirmed(hands, np.arange(2) / FPS)
    np.testing.assert_array_equal(hands, before)
