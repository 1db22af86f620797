# SPDX-License-Identifier: GPL-3.0-or-later
"""Detection of scene cuts, at which tracking starts again.

A frame begins another scene if it, and the frame after it, differ from the frame before by far more
than successive frames differ before and after. A flash lasts one frame, and a camera that pans
quickly changes every frame: neither is a cut. Frames of nearly one colour are a gap in the footage,
not a scene: the frame after them is compared with the one before them, whatever the exposure, which
a camera sets anew after it was covered.

A dissolve, or a fade through one colour, shows blends of two scenes: with A and B the patterns of
two frames that are about a second apart and differ as two scenes do, all frames between them are
a A + b B. Those of a camera that pans or zooms are not. It is a cut as soon as B differs enough
from A.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import cv2
import numpy as np

from ...arrays import Float32Array, Uint8Array

_SIZE = (32, 32)  # of the thumbnails that are compared
_STRIDE = 8  # pixels between samples of a large picture
MIN_DIFFERENCE = 22.0  # of 255, mean over the picture and colours
MIN_RATIO = 4.0  # to the usual difference
PERSISTENCE = 0.7  # share of the difference that is left a frame later
HISTORY_FRAMES = 15  # from which the usual difference is taken
MIN_CONTRAST = 8.0  # standard deviation within a picture; a blank one has less
# Where the picture turns back, the frames before and after two that are the same differ from each
# other by less than this share of what they differ from those two by.
TURNING_BACK = 0.5
# Across a gap: standard deviations, mean over the picture and colours. Of eleven clips, frames half
# a second apart differ by at most 0.44, 0.46 in all but one if half as bright again, and frames of
# two clips by at least 0.77.
MIN_DIFFERENCE_OF_PATTERN = 0.6
# Of dissolves and fades of 6 to 30 frames between two of 28 clips, the limits below find 83 %, and
# all but those between similar rooms. In none of the clips, nor in 400 pans and zooms over their
# pictures, is there a cut by them: the frames with such a difference leave at least 0.29.
BLENDED_FRAMES = 30
_BLENDED_FPS = 30.0  # at which these are a second; of higher rates, every second frame or fewer
MIN_DIFFERENCE_OF_BLENDED = 0.8  # of the patterns of the first and last of these
MAX_NOT_BLENDED = 0.2  # share of a frame's pattern, as squares, that the two do not explain


class SceneCuts:
    """Detects cuts in frames that come in order, so many per second.

    ``changes``: of each frame so far, the largest change of a place in it from the frame before, of
    255; 0 for the first. Where the picture turns back, as with a hand that waves, two frames may be
    the same though everything moves: there, it is the change of the frames beside them.
    """

    def __init__(self, fps: float) -> None:
        self.changes: list[float] = []
        self._last: Float32Array | None = None
        self._second_last: Float32Array | None = None
        self._before: Float32Array | None = None
        self._upcoming: Float32Array | None = None
        self._is_after_gap = False  # blank frames follow `_before`
        self._differences: deque[float] = deque(maxlen=HISTORY_FRAMES)
        self._every = max(1, round(fps / _BLENDED_FPS))
        self._recent: deque[Float32Array] = deque(maxlen=self._every * BLENDED_FRAMES + 1)

    def is_cut(self, image_rgb: Uint8Array, upcoming_rgb: Uint8Array | None) -> bool:
        """Return whether this frame begins another scene; the first frame of a clip does not.

        :param image_rgb: (H, W, 3).
        :param upcoming_rgb: (H, W, 3) the frame after it; None at the end of the clip.
        """
        now = _thumbnail(image_rgb) if self._upcoming is None else self._upcoming
        self._upcoming = None if upcoming_rgb is None else _thumbnail(upcoming_rgb)
        last = now if self._last is None else self._last
        self.changes.append(self._change(last, now))
        self._second_last = self._last
        self._last = now
        before = self._before
        self._before = now
        self._recent.append(now)
        if before is None:
            return False
        if now.std() < MIN_CONTRAST:
            if before.std() >= MIN_CONTRAST:
                self._before = before  # with which the scene after the gap is compared
                self._is_after_gap = True
            return False
        change = _difference(before, now)
        usual = float(np.median(self._differences)) if self._differences else 0.0
        has_contrast = before.std() >= MIN_CONTRAST
        if self._upcoming is not None:
            if (
                change >= MIN_DIFFERENCE
                and _difference(before, self._upcoming) < PERSISTENCE * change
            ):
                self._before = before  # a short disturbance, after which the scene may continue
                return False
            usual = max(usual, _difference(now, self._upcoming))
        is_cut = bool(has_contrast and change >= max(MIN_DIFFERENCE, MIN_RATIO * usual))
        if self._is_after_gap:
            is_cut = is_cut and _difference_of_pattern(before, now) >= MIN_DIFFERENCE_OF_PATTERN
            self._is_after_gap = False
        if not is_cut:
            self._differences.append(change)
            recent = list(self._recent)[:: self._every]
            is_cut = len(recent) > BLENDED_FRAMES and _is_blended(recent)
        if is_cut:
            self._recent.clear()
        return is_cut

    def _change(self, last: Float32Array, now: Float32Array) -> float:
        """Return the largest change, see ``changes``."""
        if self._second_last is not None and self._upcoming is not None:
            beside = min(
                _largest_difference(self._second_last, last),
                _largest_difference(now, self._upcoming),
            )
            if _largest_difference(self._second_last, self._upcoming) < TURNING_BACK * beside:
                return beside
        return _largest_difference(last, now)


def _thumbnail(image_rgb: Uint8Array) -> Float32Array:
    height, width = image_rgb.shape[:2]
    is_large = min(height, width) >= _STRIDE * max(_SIZE)
    coarse = (width // _STRIDE, height // _STRIDE)
    source = (
        cv2.resize(image_rgb, coarse, interpolation=cv2.INTER_NEAREST) if is_large else image_rgb
    )
    return cv2.resize(source, _SIZE, interpolation=cv2.INTER_AREA).astype(np.float32)


def _is_blended(thumbnails: Sequence[Float32Array]) -> bool:
    """Return whether the first and the last thumbnail show two scenes, and the others are blends of
    these, or of nearly one colour. A frame that differs from its neighbour is none: a flash shows a
    scene for itself.
    """
    first = thumbnails[0]
    last = thumbnails[-1]
    if min(first.std(), last.std()) < MIN_CONTRAST:
        return False
    if _difference_of_pattern(first, last) < MIN_DIFFERENCE_OF_BLENDED:
        return False
    for end, neighbour in ((first, thumbnails[1]), (last, thumbnails[-2])):
        is_blank = neighbour.std() < MIN_CONTRAST
        if not is_blank and _difference_of_pattern(end, neighbour) >= MIN_DIFFERENCE_OF_PATTERN:
            return False
    patterns = np.array([each - each.mean() for each in thumbnails if each.std() >= MIN_CONTRAST])
    patterns = patterns.reshape(len(patterns), -1)
    scenes = patterns[[0, -1]]
    shares = np.linalg.lstsq(scenes.T, patterns.T, rcond=None)[0]
    left = ((patterns - shares.T @ scenes) ** 2).sum(axis=1) / (patterns**2).sum(axis=1)
    return bool(left.max() <= MAX_NOT_BLENDED)


def _largest_difference(a: Float32Array, b: Float32Array) -> float:
    return float(np.abs(a - b).max())


def _difference(a: Float32Array, b: Float32Array) -> float:
    return float(np.abs(a - b).mean())


def _difference_of_pattern(a: Float32Array, b: Float32Array) -> float:
    """Return the difference of two thumbnails with contrast that brightness and contrast leave."""
    return _difference((a - a.mean()) / a.std(), (b - b.mean()) / b.std())
