# SPDX-License-Identifier: GPL-3.0-or-later
"""How bright it is around the eyes, over other skin: behind dark glasses the networks guess eyes that nobody sees."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

# Corners of the right and the left eye, and places on the cheek under each and on the forehead above; landmarks.
_EYES = ((33, 133), (362, 263))
_CHEEKS = ((50, 101, 205, 36), (280, 330, 425, 266))
_FOREHEAD = ((151, 108, 69), (151, 337, 299))
_HALF = 0.5  # side of the square around an eye, over twice the distance of its corners
_SPOT = 0.1  # of a place on the cheek, likewise
_DARK = 8.0  # brightness below which skin says nothing
_MIN_PX = 6.0  # distance of an eye's corners below which the square is mostly shadow and hair


def eye_light(image_rgb: NDArray[np.uint8], landmarks: NDArray[np.float64]) -> float:
    """Return the median brightness of the square around an eye over that of the skin, for the brighter eye.

    The skin is the darker one of cheek and forehead: a mask is brighter than skin. 0.6 to 1.5 with bare eyes and clear
    glasses, at most 0.4 with dark ones; 1 where the skin is too dark or the eye too small to tell, and where a landmark
    is not finite.

    :param image_rgb: (H, W, 3) uint8.
    :param landmarks: (478, 2) or (478, 3) pixels; a third column is not used.
    """
    if not np.isfinite(landmarks[:, :2]).all():
        return 1.0
    found = []
    for (first, second), *places in zip(_EYES, _CHEEKS, _FOREHEAD, strict=True):
        (ax, ay), (bx, by) = landmarks[[first, second], :2].tolist()
        width = math.hypot(ax - bx, ay - by)
        if width < _MIN_PX:
            continue
        eye = _brightness(image_rgb, (ax + bx) / 2, (ay + by) / 2, _HALF * width)
        half = _SPOT * width
        spots = [[_brightness(image_rgb, x, y, half) for x, y in landmarks[list(k), :2].tolist()] for k in places]
        skin = min(_middle(place) for place in spots)
        if not math.isnan(eye) and skin > _DARK:
            found.append(eye / skin)
    return max(found, default=1.0)


def _brightness(image: NDArray[np.uint8], x: float, y: float, half: float) -> float:
    """Return the median of green in a square around a point; NaN outside the image."""
    left, top = math.floor(x - half), math.floor(y - half)
    right, bottom = math.ceil(x + half) + 1, math.ceil(y + half) + 1
    height, width = image.shape[:2]
    if top >= height or left >= width or bottom <= 0 or right <= 0:
        return math.nan
    part = image[max(top, 0) : bottom, max(left, 0) : right, 1]
    low, high = (part.size - 1) // 2, part.size // 2
    ordered = np.partition(part, (low, high), axis=None)
    return (int(ordered[low]) + int(ordered[high])) / 2


def _middle(values: list[float]) -> float:
    """Return the median of a few values, NaN if one is; `np.median` takes far longer for so few."""
    if any(map(math.isnan, values)):
        return math.nan
    ordered = sorted(values)
    return (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) / 2
