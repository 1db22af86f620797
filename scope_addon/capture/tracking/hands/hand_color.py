# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour of a hand: what the network imagines over clothes or a chair has another than the hand had before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..appearance import sample

_KNUCKLES, _MIDDLES = [5, 9, 13, 17], [6, 10, 14, 18]  # keypoints of a hand: bases and middle joints of the fingers
_ALONG = (1 / 3, 2 / 3)  # places on the palm, from the wrist to the knuckles
_DARK = 8.0  # added to colours, which say little below it
MAX_SHADE = 0.7  # change of a channel's logarithm that light can make from one frame to another
MAX_TINT = 0.08  # change of a channel's share of all three


def palm_color(image_rgb: NDArray[np.uint8], keypoints_px: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the median colour (3,) at places on palm and fingers; None if none of them is in the image.

    :param image_rgb: (H, W, 3) uint8.
    :param keypoints_px: (21, 2) of the hand.
    """
    wrist, knuckles = keypoints_px[0], keypoints_px[_KNUCKLES]
    places = [knuckles, keypoints_px[_MIDDLES], *(wrist + share * (knuckles - wrist) for share in _ALONG)]
    pixels = sample(image_rgb, np.concatenate(places))
    return np.asarray(np.median(pixels.astype(float), axis=0)) if len(pixels) else None


def is_like(color: NDArray[np.float64] | None, before: NDArray[np.float64] | None) -> bool:
    """Return whether a colour (3,) and an earlier one (3,) can be one hand's; also where one of them is not known.

    Light and shadow change all channels by one factor, which may be large; something else differs in tint as well.
    """
    if color is None or before is None:
        return True
    a, b = color + _DARK, before + _DARK
    shade = float(np.abs(np.log(a / b)).max())
    tint = float(np.abs(a / a.sum() - b / b.sum()).max())
    return shade <= MAX_SHADE or tint <= MAX_TINT
