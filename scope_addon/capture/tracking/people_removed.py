# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture from which people are removed, so that the detector finds those behind them.

The detector looks at small pictures, in which somebody partly behind another person is one spot
with that person. Where the person in front has been painted over with what surrounds them, the rest
of the other one is detected by itself; and the landmark network, which takes the foremost person of
its region, takes the right one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import cv2
import numpy as np

from ...arrays import FloatArray, Uint8Array
from ...footage_view import scaled_size
from ..perception.region import Region

LARGEST_SIDE_PX = 448  # of the picture in which is painted: twice the detector's input
_SURE = 0.5  # probability from which a pixel belongs to the person
_BORDER_PX = 5  # the masks are a little too narrow
_RADIUS_PX = 3  # of inpainting; a larger one takes longer, and makes no difference to the detector


def remove_people(image_rgb: Uint8Array, people: Sequence[tuple[Region, FloatArray]]) -> Uint8Array:
    """Return a picture (H, W, 3) in which people are painted over with their surroundings.

    The paint has a lower resolution than the picture.

    :param image_rgb: (H, W, 3).
    :param people: a region of the landmark network and the probability (S, S) in its crop, of each.
    """
    height, width = image_rgb.shape[:2]
    _, size = scaled_size(width, height, min(LARGEST_SIDE_PX, max(width, height)))
    shrinkage = np.array(size) / (width, height)
    probability = np.zeros(size[::-1], np.float32)
    for region, mask in people:
        A = region.image_from_pixels(len(mask)) * shrinkage[:, None]
        A[:, 2] += 0.5 * shrinkage - 0.5  # of the centres of the first pixels
        probability = np.maximum(probability, cv2.warpAffine(mask.astype(np.float32), A, size))
    shown = (probability > _SURE).astype(np.uint8)
    removed = cv2.dilate(shown, np.ones((_BORDER_PX, _BORDER_PX), np.uint8))
    small_rgb = cv2.resize(image_rgb, size, interpolation=cv2.INTER_AREA)
    painted_rgb = cv2.inpaint(small_rgb, removed, _RADIUS_PX, cv2.INPAINT_TELEA)
    is_removed = cv2.resize(removed, (width, height), interpolation=cv2.INTER_NEAREST) > 0
    paint_rgb = cv2.resize(painted_rgb, (width, height), interpolation=cv2.INTER_LINEAR)
    return cast(Uint8Array, np.where(is_removed[..., None], paint_rgb, image_rgb))
