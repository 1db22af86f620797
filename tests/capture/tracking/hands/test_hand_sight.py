# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour of a palm, and which colours can be one hand's."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.capture.tracking.hand_sight import is_like, palm_color

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
