# SPDX-License-Identifier: GPL-3.0-or-later
"""How bright it is around the eyes, over other skin: behind dark glasses the networks guess eyes that nobody sees."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Corners of the right and the left eye, and places on the cheek under each and on the forehead above; landmarks.
_EYES = ((33, 133), (362, 263))
_CHEEKS = ((50, 101, 205, 36), (280, 330, 425, 266))
_FOREHEAD = ((151, 108, 69), (151, 337, 299))
_HALF = 0.5  # side of the square around an eye, over twice the distance of its corners
_SPOT = 0.1  # of a place on the cheek, likewise
_DARK = 8.0  # brightness below which skin says nothing
_LEAST_PX = 6.0  # distance of an eye's corners below which the square is mostly shadow and hair


def eye_light(image_rgb: NDArray[np.uint8], landmarks: NDArray[np.float64]) -> float:
    """Return the median brightness of the square around an eye over that of the skin, for the brighter eye.

    The skin is the darker one of cheek and forehead: a mask is brighter than skin. 0.6 to 1.5 with bare eyes and clear
    glasses, at most 0.4 with dark ones; 1 where the skin is too dark or the eye too small to tell.

    :param image_rgb: (H, W, 3) uint8.
    :param landmarks: (478, 2) or (478, 3) pixels; a third column is not used.
    """
    found = []
    for corners, *places in zip(_EYES, _CHEEKS, _FOREHEAD, strict=True):
        a, b = landmarks[list(corners), :2]
        width = float(np.linalg.norm(a - b))
        if width < _LEAST_PX:
            continue
        eye = _brightness(image_rgb, (a + b) / 2, _HALF * width)
        spots = [[_brightness(image_rgb, landmarks[k, :2], _SPOT * width) for k in place] for place in places]
        skin = min(_middle(np.array(place)) for place in spots)
        if np.isfinite([eye, skin]).all() and skin > _DARK:
            found.append(eye / skin)
    return max(found, default=1.0)


def _brightness(image: NDArray[np.uint8], center: NDArray[np.float64], half: float) -> float:
    """Return the median of green in a square around a point; NaN outside the image."""
    (left, top), (right, bottom) = np.floor(center - half), np.ceil(center + half) + 1
    height, width = image.shape[:2]
    rows, columns = (slice(max(int(a), 0), max(int(b), 0)) for a, b in ((top, bottom), (left, right)))
    part = image[rows, columns, 1] if top < height and left < width else image[:0, 0, 1]
    return _middle(part.ravel()) if part.size else float("nan")


def _middle(values: NDArray[Any]) -> float:
    """Return the median of values (n,), n > 0, NaN if one is; `np.median` takes four times as long for so few."""
    low, high = (len(values) - 1) // 2, len(values) // 2
    ordered = np.sort(values)  # NaN comes last
    if ordered[-1] != ordered[-1]:
        return float("nan")
    return (float(ordered[low]) + float(ordered[high])) / 2
