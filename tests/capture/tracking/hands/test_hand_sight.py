# SPDX-License-Identifier: GPL-3.0-or-later
"""A hand in a part of a frame that was kept: the network's places are those of the frame.

The colour of a palm, and which colours can be one hand's.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.hand_landmarks import HandEstimate
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.hand_sight import (
    Sight,
    followed_regions,
    is_like,
    palm_color,
)

WRIST = KEYPOINT_NAMES.index("left_wrist")


class BrightestPixel:
    """Sees a hand whose wrist is the brightest pixel of the image that it is given."""

    def estimate(self, image, region):
        y, x = np.unravel_index(image[..., 0].argmax(), image.shape[:2])
        points = np.tile([float(x), float(y)], (21, 1))
        return HandEstimate(points, np.zeros((21, 3)), 0.9, 0.9, region)


@pytest.mark.parametrize("place", [(300, 200), (3, 5), (637, 478)])
def test_a_part_of_the_frame_gives_the_places_in_the_frame(place):
    image = np.zeros((480, 640, 3), np.uint8)
    image[place[1], place[0]] = 255
    keypoints = np.zeros((33, 2))
    keypoints[WRIST] = np.add(place, 4.0)
    person = Observation(
        keypoints, np.ones(33), np.zeros((33, 3)), 1.0, Region((0.0, 0.0), 1.0, 0.0), False
    )
    sight = Sight(image, person, 0, 200.0, None)  # a hand has 36 pixels
    kept = sight.around_wrist()
    assert kept.image_rgb.size < 0.1 * image.size
    image[:] = 0  # what is kept is a copy
    found = kept.estimate(BrightestPixel(), Region(place, 50.0, 0.0))
    np.testing.assert_array_equal(found.keypoints_px, np.tile(place, (21, 1)))
    assert found.region.center_px == place


def test_only_a_hand_that_moves_far_is_looked_for_in_two_places():
    points = 40.0 * np.random.default_rng(0).uniform(-1, 1, (21, 2)) + 300.0
    hand = HandEstimate(points, np.zeros((21, 3)), 0.9, 0.9, Region((300.0, 300.0), 100.0, 0.0))
    (near,) = followed_regions(hand, np.array([5.0, 0.0]), 40.0)
    moved, there = followed_regions(hand, np.array([30.0, -10.0]), 40.0)
    assert near == there == hand.next_region
    np.testing.assert_allclose(np.subtract(moved.center_px, there.center_px), [30.0, -10.0])


SKIN = np.array([134.0, 104, 79])


TROUSERS = np.array([26.0, 40, 45])


HAND = np.array([[0.0, 0.0], *([x, y] for x in (-8, -4, 0, 4, 8) for y in (-10, -13, -16, -20))])


def test_the_palm_gives_the_colour_and_its_surroundings_do_not():
    image = np.full((100, 100, 3), TROUSERS, np.uint8)
    image[38:66, 40:62] = SKIN
    np.testing.assert_array_equal(palm_color(image, HAND + [50, 62]), SKIN)
    np.testing.assert_array_equal(palm_color(image, HAND + [20, 90]), TROUSERS)


def test_shadow_leaves_a_hand_alike_and_cloth_does_not():
    assert is_like(0.35 * SKIN, SKIN)
    assert is_like(2.0 * SKIN, SKIN)
    assert not is_like(TROUSERS, SKIN)
    assert not is_like(SKIN, TROUSERS)
    assert is_like(0.75 * SKIN + 0.25 * np.array([160.0, 160, 165]), SKIN)  # blurred over a wall
