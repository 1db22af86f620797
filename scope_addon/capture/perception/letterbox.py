# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits an image into a network's input (letterboxing), and maps positions back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np

from ...arrays import Float64Array, Uint8Array

_HALVING_FROM = 4.0  # ratio of the sizes


@dataclass(frozen=True)
class Letterbox:
    """The network's input and its mapping from image pixels: input = scale · (pixel + ½) + offset.

    ``picture_rgb`` (height, width, 3) uint8; ``scale``, ``offset`` (2,) in x and y.
    """

    picture_rgb: Uint8Array
    scale: Float64Array
    offset: Float64Array

    def to_image(self, points: Float64Array) -> Float64Array:
        """Convert positions (..., 2) in the network's input to pixels (..., 2) of the image."""
        return (points - self.offset) / self.scale - 0.5


def fit_in(
    image_rgb: Uint8Array,
    width: int,
    height: int,
    *,
    border: int,
    centered: bool = True,
    stretched: bool = False,
) -> Letterbox:
    """Resize the image to a network's input.

    :param image_rgb: (H, W, 3) uint8.
    :param width, height: of the input, pixels.
    :param border: grey level around the image.
    :param centered: place the image in the middle rather than in the top left corner.
    :param stretched: fill the input regardless of the aspect ratio.
    """
    rows, columns = image_rgb.shape[:2]
    if stretched:
        size = width, height
    else:
        scale = min(width / columns, height / rows)
        size = max(1, round(columns * scale)), max(1, round(rows * scale))
    left, top = ((width - size[0]) // 2, (height - size[1]) // 2) if centered else (0, 0)
    picture = np.full((height, width, 3), border, np.uint8)
    picture[top : top + size[1], left : left + size[0]] = _resize(image_rgb, *size)
    return Letterbox(
        picture, np.array([size[0] / columns, size[1] / rows]), np.array([left, top], float)
    )


def _resize(image: Uint8Array, width: int, height: int) -> Uint8Array:
    """Resize without aliasing."""
    if width >= image.shape[1]:
        return cast(Uint8Array, cv2.resize(image, (width, height), interpolation=cv2.INTER_LINEAR))
    while min(image.shape[1] / width, image.shape[0] / height) >= _HALVING_FROM:
        image = halved(image)
    return cast(Uint8Array, cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA))


def halved(image: Uint8Array) -> Uint8Array:
    """Halve an (H, W, 3) image by averaging 2 × 2 pixels, OpenCV's fast path of INTER_AREA."""
    size = image.shape[1] // 2, image.shape[0] // 2
    return cast(Uint8Array, cv2.resize(image, size, interpolation=cv2.INTER_AREA))
