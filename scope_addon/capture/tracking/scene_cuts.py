# SPDX-License-Identifier: GPL-3.0-or-later
"""Where footage cuts from one scene to another: whoever was followed is not there any more, though others may be.

A cut is a frame that differs from the one before by far more than frames differ before and after it, and so does the
next one: a flash passes, a camera that swings differs all the time. What is nearly of one colour is a gap, no scene.
"""

from __future__ import annotations

from collections import deque

import cv2
import numpy as np

_SIZE = (32, 32)  # of the small pictures that are compared
_STEP = 8  # every so many pixels and lines are looked at
DIFFERENT = 22.0  # of 255, mean over the picture and colours
TIMES_USUAL = 4.0
LASTS = 0.7  # of the difference that is left a frame later
LATE = 15  # frames that say what is usual
PLAIN = 8.0  # deviation within a picture that shows nothing
SCENE_GAP_S = 10.0  # added to a track's times at a cut, so that nothing is drawn from one scene into the next


class SceneCuts:
    """Frames come in order, each with the one after it; ``times_s`` of the first frames after cuts."""

    def __init__(self) -> None:
        self.times_s: list[float] = []
        self._before: np.ndarray | None = None
        self._upcoming: np.ndarray | None = None
        self._usual: deque[float] = deque(maxlen=LATE)

    def is_cut(self, image_rgb: np.ndarray, upcoming_rgb: np.ndarray | None, time_s: float) -> bool:
        """Whether this frame begins another scene; a clip's first frame does not."""
        now = _small(image_rgb) if self._upcoming is None else self._upcoming
        self._upcoming = None if upcoming_rgb is None else _small(upcoming_rgb)
        before, self._before = self._before, now
        if before is None:
            return False
        change, usual = _difference(before, now), float(np.median(self._usual)) if self._usual else 0.0
        shows = min(before.std(), now.std()) >= PLAIN
        if self._upcoming is not None:
            if change >= DIFFERENT and _difference(before, self._upcoming) < LASTS * change:
                self._before = before  # something passes; what is behind it may go on
                return False
            usual = max(usual, _difference(now, self._upcoming))
        if not shows or change < max(DIFFERENT, TIMES_USUAL * usual):
            self._usual.append(change)
            return False
        self.times_s.append(time_s)
        return True


def _small(image_rgb: np.ndarray) -> np.ndarray:
    height, width = image_rgb.shape[:2]
    if min(height, width) >= _STEP * max(_SIZE):
        image_rgb = cv2.resize(image_rgb, (width // _STEP, height // _STEP), interpolation=cv2.INTER_NEAREST)
    return cv2.resize(image_rgb, _SIZE, interpolation=cv2.INTER_AREA).astype(np.float32)


def _difference(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).mean())
