# SPDX-License-Identifier: GPL-3.0-or-later
"""An image whose corners tell how it was rotated."""

from __future__ import annotations

import cv2
import numpy as np

W = 64
H = 48


def corner_image(width: int = W, height: int = H) -> np.ndarray:
    """Create an RGB image: red top left, green top right, blue bottom left, white bottom right."""
    image = np.full((height, width, 3), 255, np.uint8)
    image[: height // 2, : width // 2] = (255, 0, 0)
    image[: height // 2, width // 2 :] = (0, 255, 0)
    image[height // 2 :, : width // 2] = (0, 0, 255)
    return image


def corners(image: np.ndarray) -> str:
    """Name the colours of the corners (top left, top right, bottom left, bottom right) by their
    first letters.
    """
    names: dict[tuple[int, ...], str] = {
        (1, 0, 0): "r",
        (0, 1, 0): "g",
        (0, 0, 1): "b",
        (1, 1, 1): "w",
    }
    points = [image[6, 6], image[6, -7], image[-7, 6], image[-7, -7]]
    return "".join(names.get(tuple(int(c > 128) for c in p), "?") for p in points)


def encode(suffix: str, image: np.ndarray) -> bytes:
    code = cv2.COLOR_RGBA2BGRA if image.shape[2] == 4 else cv2.COLOR_RGB2BGR
    return cv2.imencode(suffix, cv2.cvtColor(image, code))[1].tobytes()
