# SPDX-License-Identifier: GPL-3.0-or-later
"""Decoded frames of the footage, and brighter copies of dark ones for the networks, which miss
people in the dark or misplace their limbs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np

from ...arrays import Uint8Array


@dataclass(frozen=True)
class Frame:
    """One frame: source index, presentation time in seconds, and the upright image (H, W, 3) uint8
    RGB.
    """

    index: int
    timestamp_s: float
    image_rgb: Uint8Array


# Highlights below DARK, of 255, are raised to BRIGHT.
DARK = 110.0
BRIGHT = 200.0
BLACK = 4.0  # highlights below which a frame shows nothing
MAX_GAIN = 16.0
# The share of a change of gain that is applied per frame, so that brightness does not flicker.
SMOOTHING = 0.1
LIGHT_CHANGE = 2.0  # factor from which the light was switched and the gain changes at once
_STEP = 16  # pixels and lines between samples
_HIGHLIGHT_QUANTILE = 0.98  # of the brightness, above which pixels are highlights


class AutoExposure:
    """Automatic gain for the frames of one clip, which are passed in order."""

    def __init__(self) -> None:
        self._gain = 0.0

    def brighten(self, image_rgb: Uint8Array) -> Uint8Array:
        """Return the frame itself, or a brighter copy: each channel times BRIGHT / highlights, at
        most `MAX_GAIN`.

        :param image_rgb: (H, W, 3) uint8.
        :return: (H, W, 3) uint8.
        """
        size = max(1, image_rgb.shape[1] // _STEP), max(1, image_rgb.shape[0] // _STEP)
        samples = cv2.cvtColor(
            cv2.resize(image_rgb, size, interpolation=cv2.INTER_NEAREST), cv2.COLOR_RGB2GRAY
        ).ravel()
        rank = int(_HIGHLIGHT_QUANTILE * len(samples))
        level = float(np.partition(samples, rank)[rank])
        if level < BLACK:
            return image_rgb
        wanted = min(BRIGHT / level, MAX_GAIN) if level < DARK else 1.0
        if self._gain == 0.0 or not 1 / LIGHT_CHANGE < wanted / self._gain < LIGHT_CHANGE:
            self._gain = wanted
        self._gain += SMOOTHING * (wanted - self._gain)
        if self._gain < 1.05:
            return image_rgb
        return cast(Uint8Array, cv2.convertScaleAbs(image_rgb, alpha=self._gain))
