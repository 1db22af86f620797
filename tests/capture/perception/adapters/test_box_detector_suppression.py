# SPDX-License-Identifier: GPL-3.0-or-later
"""Letterboxing there and back, and non-maximum suppression of more boxes than a network should
have.
"""

from __future__ import annotations

import numpy as np
from scope.scope_addon.capture.perception.adapters.box_detector import (
    BORDER,
    MAX_BOXES,
    Boxes,
    suppress,
)
from scope.scope_addon.capture.perception.letterbox import fit_in

from .person_in_picture import HEIGHT, WIDTH


def test_the_letterbox_maps_back_to_the_image() -> None:
    image = np.zeros((251, 333, 3), np.uint8)
    image[100:111, 200:211] = 255  # its middle: pixel 105, 205
    for settings in (
        {"centered": True},
        {"centered": False},
        {"centered": False, "stretched": True},
    ):
        look = fit_in(image, WIDTH, HEIGHT, border=BORDER, **settings)
        assert look.picture_rgb.shape == (HEIGHT, WIDTH, 3)
        heat = np.where(look.picture_rgb[..., 0] > 114, look.picture_rgb[..., 0] - 114.0, 0)
        inside = heat[2:-2, 2:-2]
        y, x = (np.indices(inside.shape) * inside).sum(axis=(1, 2)) / inside.sum() + 2.5
        np.testing.assert_allclose(look.to_image(np.array([x, y])), [205, 105], atol=0.5)


def test_of_millions_of_boxes_only_the_best_are_compared() -> None:
    """All of a million, which lie apart, would take hours."""
    corners = np.stack(
        [np.arange(1e6), np.zeros(10**6), np.arange(1e6) + 0.5, np.ones(10**6)], axis=1
    )
    kept = suppress(Boxes(corners, np.linspace(0.5, 1.0, 1_000_000)), 0.4)
    assert len(kept.scores) == MAX_BOXES
    np.testing.assert_array_equal(kept.corners[:, 0], np.arange(10**6 - MAX_BOXES, 10**6)[::-1])
