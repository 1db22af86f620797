# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds palms in a square of the image: a box and seven points each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from .execution import Execution
from .hand_region import region_from_palm
from .person_detector import decode, make_anchors, merge_overlapping
from .region import Region
from .sessions import network_path, open_session

INPUT_SIZE = 192
SCORE_THRESHOLD = 0.5
_LAYERS = ((8, 2), (16, 6))  # stride, anchors per cell; the three stride-16 layers lie together


@dataclass(frozen=True)
class Palm:
    """``score`` 0..1 and the region in which the hand network should look."""

    score: float
    region: Region


class PalmDetector:
    """The palm detection network on the CPU; keeps nothing between calls."""

    def __init__(self, threads: int, folder: Path | None = None, execution: Execution | None = None) -> None:
        self._session = open_session(network_path("palm_detection", folder), threads, execution)
        self._anchors = make_anchors(INPUT_SIZE, _LAYERS)

    def detect(self, image_rgb: np.ndarray, where: Region, threshold: float = SCORE_THRESHOLD) -> list[Palm]:
        """All palms in a square of an (H, W, 3) uint8 image, best first."""
        blob = cv2.dnn.blobFromImage(where.cut(image_rgb, INPUT_SIZE), 1 / 255.0)
        boxes, scores = self._session.run(["boxes", "scores"], {"input": blob})
        score, values = merge_overlapping(*decode(boxes[0], scores[0, :, 0], self._anchors, threshold))
        return [Palm(float(s), _in_image(v, where)) for s, v in zip(score, values, strict=True)]


def _in_image(values: np.ndarray, where: Region) -> Region:
    """The hand's region in the image from a box and points (18,) in the square's input pixels."""
    unit = values / INPUT_SIZE
    there = region_from_palm(unit[:4], unit[4:].reshape(-1, 2))
    x, y = where.image_from_crop(np.array(there.center_px))
    return Region((float(x), float(y)), there.side_px * where.side_px, there.rotation + where.rotation)
