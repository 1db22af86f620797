# SPDX-License-Identifier: GPL-3.0-or-later
"""Removal of people from a picture, of drawn discs whose place is known."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.people_removed import remove_people


@pytest.mark.parametrize(("size", "turn_rad"), [((320, 240), 0.0), ((540, 960), 0.7)])
def test_what_the_mask_shows_is_painted_over_and_nothing_else_is(
    size: tuple[int, int], turn_rad: float
) -> None:
    width, height = size
    side_px = 0.8 * min(size)
    region = Region((0.4 * width, 0.55 * height), side_px, turn_rad)
    # A disc that is off the centre of its region, and beyond it a second one that is nobody's.
    center_px = region.image_from_crop(np.array([0.7, 0.4]))
    other_px = (0.9 * width, 0.12 * height)
    radius_px = 0.15 * side_px
    image = np.full((height, width, 3), 60, np.uint8)
    for x, y in (center_px, other_px):
        cv2.circle(image, (round(x), round(y)), round(radius_px), (250, 250, 250), -1)
    mask = np.zeros((256, 256), np.float16)
    rows, columns = np.mgrid[0:256, 0:256] / 256
    mask[np.hypot(columns - 0.7, rows - 0.4) < 0.16] = 0.9

    rest = remove_people(image, [(region, mask)])

    y, x = np.mgrid[0:height, 0:width]
    from_center = np.hypot(x - center_px[0], y - center_px[1])
    assert rest[from_center < radius_px].max() < 70
    beyond = from_center > 0.2 * side_px
    np.testing.assert_array_equal(rest[beyond], image[beyond])
    assert image[from_center < 0.9 * radius_px].min() == 250  # the given picture is unchanged
