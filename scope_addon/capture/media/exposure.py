# SPDX-License-Identifier: GPL-3.0-or-later
"""Dark footage brightened for the networks, which see wrong limbs, or nobody, where people still see a person."""

from __future__ import annotations

import cv2
import numpy as np

DARK, BRIGHT = 110.0, 200.0  # of 255: brightest places below which a picture is dark, and what they become
BLACK = 4.0  # below which there is nothing to see
MOST_GAIN = 16.0
FOLLOWS = 0.1  # of the change from one frame to the next, so that brightness does not flicker
LEAP = 2.0  # a factor by which light changes at once
_STEP = 16  # every so many pixels and lines are looked at
_BRIGHTER = 0.98  # share of the picture that is darker than its brightest places


class AutoExposure:
    """Frames come in order."""

    def __init__(self) -> None:
        self._gain = 0.0

    def brighten(self, image_rgb: np.ndarray) -> np.ndarray:
        """The frame itself, or a copy that is brighter: gain times each channel, BRIGHT over the brightest places."""
        size = max(1, image_rgb.shape[1] // _STEP), max(1, image_rgb.shape[0] // _STEP)
        few = cv2.cvtColor(cv2.resize(image_rgb, size, interpolation=cv2.INTER_NEAREST), cv2.COLOR_RGB2GRAY).ravel()
        bright = int(_BRIGHTER * len(few))
        level = float(np.partition(few, bright)[bright])
        if level < BLACK:
            return image_rgb
        wanted = min(BRIGHT / level, MOST_GAIN) if level < DARK else 1.0
        if self._gain == 0.0 or not 1 / LEAP < wanted / self._gain < LEAP:
            self._gain = wanted
        self._gain += FOLLOWS * (wanted - self._gain)
        return image_rgb if self._gain < 1.05 else cv2.convertScaleAbs(image_rgb, alpha=self._gain)
