# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture that the panel shows while a capture runs: the current frame, small, the found skeleton drawn over it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from ..capture.landmark_network import KEYPOINT_NAMES
from ..capture.tracker import Observation
from ..capture.video import Frame

LONGER_SIDE = 256  # pixels; Blender keeps such pictures no larger
INTERVAL_S = 0.3
FILE = "preview.rgba"
_SUPERSAMPLE = 2  # lines are drawn in a picture twice as large, so that they come out smooth

_LEFT, _RIGHT, _MIDDLE = (255, 140, 40), (40, 150, 255), (235, 235, 235)
_LIMBS = ("shoulder elbow", "elbow wrist", "wrist index", "shoulder hip", "hip knee", "knee ankle", "ankle foot_index")
_LINES = [("left_shoulder", "right_shoulder", _MIDDLE), ("left_hip", "right_hip", _MIDDLE)]
for _side, _color in (("left", _LEFT), ("right", _RIGHT)):
    _LINES += [(f"{_side}_{a}", f"{_side}_{b}", _color) for a, b in map(str.split, _LIMBS)]


class PreviewWriter:
    """Writes the preview now and then, and tells of it: ``send("preview", file, width, height, frame)``.

    The file holds RGBA bytes, the lowest row first, as Blender wants them.
    """

    def __init__(self, folder: Path, send: Callable[..., None]) -> None:
        self._path, self._send = folder / FILE, send
        self._last = -np.inf

    def __call__(self, frame: Frame, observation: Observation | None) -> None:
        """As ``capture`` calls it, with every frame."""
        now = time.monotonic()
        if now - self._last < INTERVAL_S:
            return
        self._last = now
        picture = draw(frame.image_rgb, observation)
        height, width = picture.shape[:2]
        beside = self._path.with_suffix(".part")
        try:
            beside.write_bytes(picture[::-1].tobytes())
            os.replace(beside, self._path)
        except OSError:
            return  # a full disk, or Windows while the other side reads: a capture does not fail for its picture
        self._send("preview", file=FILE, width=width, height=height, frame=frame.index)


def draw(image_rgb: np.ndarray, observation: Observation | None) -> np.ndarray:
    """The frame scaled down, with the skeleton: (h, w, 4) uint8 RGBA."""
    height, width = image_rgb.shape[:2]
    scale = LONGER_SIDE / max(height, width)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    large = cv2.resize(image_rgb, (size[0] * _SUPERSAMPLE, size[1] * _SUPERSAMPLE), interpolation=cv2.INTER_AREA)
    if observation is not None:
        pixels = np.round((observation.keypoints_px + 0.5) * scale * _SUPERSAMPLE).astype(int)
        for a, b, color in _LINES:
            i, j = KEYPOINT_NAMES.index(a), KEYPOINT_NAMES.index(b)
            if min(observation.keypoints_confidence[[i, j]]) > 0.3:
                cv2.line(large, pixels[i].tolist(), pixels[j].tolist(), color, 2 * _SUPERSAMPLE, cv2.LINE_AA)
    return cv2.cvtColor(cv2.resize(large, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2RGBA)
