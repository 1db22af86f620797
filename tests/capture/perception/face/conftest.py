# SPDX-License-Identifier: GPL-3.0-or-later
"""A real face, as the landmark network sees it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.perception.face_landmarks import FaceEstimate, FaceNetwork
from scope.scope_addon.capture.perception.region import Region


@pytest.fixture(scope="module")
def network() -> FaceNetwork:
    return FaceNetwork()


@pytest.fixture(scope="module")
def face(shared: Path, network: FaceNetwork) -> tuple[np.ndarray, FaceEstimate]:
    video = cv2.VideoCapture(str(shared / "data" / "clips" / "squats_5fps.mp4"))
    ok, frame = video.read()
    assert ok
    image = np.ascontiguousarray(frame[:, :, ::-1])
    head = network.estimate(image, Region(_head(image), 130.0, 0.0))
    return image, network.estimate(image, head.next_region)


def _head(image: np.ndarray) -> tuple[float, float]:
    """The middle of the skin-coloured pixels of the upper part of the picture, which are the
    face's.
    """
    hue, saturation, value = cv2.split(cv2.cvtColor(image, cv2.COLOR_RGB2HSV))
    skin = ((hue < 20) | (hue > 170)) & (saturation > 30) & (saturation < 160) & (value > 120)
    rows, columns = np.nonzero(skin[: image.shape[0] // 4])
    return float(np.median(columns)), float(np.median(rows))
