# SPDX-License-Identifier: GPL-3.0-or-later
"""The palm detector: finds palms in a square of the image, a box and seven points each."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .execution import Execution
from .hand_region import region_from_palm
from .person_detector import decode, make_anchors, merge_overlapping
from .region import Region
from .sessions import network_path, open_session

INPUT_SIZE = 192
SCORE_THRESHOLD = 0.5
_LAYERS = ((8, 2), (16, 6))  # stride, anchors per cell; the three stride-16 layers are combined


class PalmDetector:
    """The palm detection network; stateless between calls.

    :raises SetupError: the network has not been built.
    :raises ModelFileError: its file is damaged.
    """

    def __init__(self, threads: int, execution: Execution | None = None) -> None:
        self._session = open_session(network_path("palm_detection"), threads, execution)
        self._anchors = make_anchors(INPUT_SIZE, _LAYERS)

    def detect(self, image_rgb: NDArray[np.uint8], square: Region, threshold: float = SCORE_THRESHOLD) -> list[Region]:
        """Return the hands' regions by all palms in a square of an (H, W, 3) uint8 RGB image, the best palm first."""
        blob = cv2.dnn.blobFromImage(square.cut(image_rgb, INPUT_SIZE), 1 / 255.0)
        boxes, scores = self._session.run(["boxes", "scores"], {"input": blob})
        _, values = merge_overlapping(*decode(boxes[0], scores[0, :, 0], self._anchors, threshold))
        return [_in_image(v, square) for v in values]


def _in_image(values: NDArray[np.float64], square: Region) -> Region:
    """Calculate the hand's region in the image from a box and points (18,) in the network's input pixels."""
    unit = values / INPUT_SIZE
    in_square = region_from_palm(unit[:4], unit[4:].reshape(-1, 2))
    x, y = square.image_from_crop(np.array(in_square.center_px))
    return Region((float(x), float(y)), in_square.side_px * square.side_px, in_square.rotation + square.rotation)
