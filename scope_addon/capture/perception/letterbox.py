# SPDX-License-Identifier: GPL-3.0-or-later
"""An image within the picture that a network looks at, and the way back."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

_HALVED_FROM = 4.0  # times the size


@dataclass(frozen=True)
class Letterbox:
    """Where the image lies in the network's picture: picture = scale · (pixel + ½) + offset."""

    picture_rgb: np.ndarray
    scale: np.ndarray  # (x, y)
    offset: np.ndarray  # (x, y)

    def to_image(self, points: np.ndarray) -> np.ndarray:
        """Positions (..., 2) in the network's picture to pixels of the image."""
        return (points - self.offset) / self.scale - 0.5


def fit_in(
    image_rgb: np.ndarray, width: int, height: int, *, border: int, centered: bool = True, stretched: bool = False
) -> Letterbox:
    """The image at one scale within a picture of one grey, in its middle or top left corner; or stretched over it."""
    rows, columns = image_rgb.shape[:2]
    if stretched:
        size = width, height
    else:
        scale = min(width / columns, height / rows)
        size = max(1, round(columns * scale)), max(1, round(rows * scale))
    left, top = ((width - size[0]) // 2, (height - size[1]) // 2) if centered else (0, 0)
    picture = np.full((height, width, 3), border, np.uint8)
    picture[top : top + size[1], left : left + size[0]] = _resized(image_rgb, *size)
    return Letterbox(picture, np.array([size[0] / columns, size[1] / rows]), np.array([left, top], float))


def _resized(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """Of that size, without aliasing."""
    if width >= image.shape[1]:
        return cv2.resize(image, (width, height), interpolation=cv2.INTER_LINEAR)
    while min(image.shape[1] / width, image.shape[0] / height) >= _HALVED_FROM:
        image = halved(image)
    return cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)


def halved(image: np.ndarray) -> np.ndarray:
    """Two by two pixels in one, which OpenCV averages several times as fast as any other number."""
    return cv2.resize(image, (image.shape[1] // 2, image.shape[0] // 2), interpolation=cv2.INTER_AREA)
