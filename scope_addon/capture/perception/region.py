# SPDX-License-Identifier: GPL-3.0-or-later
"""The rotated square of the image that a landmark network looks at.

Image coordinates are OpenCV's: the centre of the top left pixel is (0, 0), y runs down. Crop coordinates s run from
(0, 0) at the top left corner of the square to (1, 1) at its bottom right one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from .letterbox import halved

MARGIN = 1.25  # the square is this much larger than twice the distance between the two points


@dataclass(frozen=True)
class Region:
    """A square of ``side_px`` about ``center_px`` (x, y), turned by ``rotation`` radians, clockwise on screen."""

    center_px: tuple[float, float]
    side_px: float
    rotation: float

    @property
    def R_image_crop(self) -> np.ndarray:
        """(2, 2) directions in the square to directions in the image: [[c, −s], [s, c]]."""
        c, s = math.cos(self.rotation), math.sin(self.rotation)
        return np.array([[c, -s], [s, c]])

    def image_from_crop(self, points: np.ndarray) -> np.ndarray:
        """Pixels of crop points (..., 2): p = center + side · R · (s − ½)."""
        return np.asarray(self.center_px) + self.side_px * (np.asarray(points) - 0.5) @ self.R_image_crop.T

    def crop_from_image(self, points: np.ndarray) -> np.ndarray:
        """Crop points of pixels (..., 2), the inverse of `image_from_crop`."""
        return (np.asarray(points) - np.asarray(self.center_px)) @ self.R_image_crop / self.side_px + 0.5

    def cut(self, image_rgb: np.ndarray, size: int) -> np.ndarray:
        """The square as a (size, size, 3) picture; beyond the image's edge, its outermost pixels go on.

        Black instead costs the landmark networks 3 mm on people who touch the edge.
        """
        source, A = image_rgb, self._image_from_pixel(size)
        if self.side_px >= 2 * size:
            source, A = _shrink(image_rgb, A, size, int(self.side_px / size).bit_length() - 1)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return cv2.warpAffine(source, A, (size, size), flags=flags, borderMode=cv2.BORDER_REPLICATE)

    def rotate_to_camera(self, vectors: np.ndarray) -> np.ndarray:
        """3D vectors (..., 3) in the square's axes (x right, y down, z forward) turned into the camera's axes."""
        R_camera_crop = np.eye(3)
        R_camera_crop[:2, :2] = self.R_image_crop
        return np.asarray(vectors) @ R_camera_crop.T

    def is_near(self, other: Region) -> bool:
        """Whether somebody in the one may hide somebody in the other: centres within three quarters of a side."""
        return math.dist(self.center_px, other.center_px) <= 0.75 * max(self.side_px, other.side_px)

    def resembles(self, other: Region, distance: float) -> bool:
        """Whether both may hold the same person: centres within ``distance`` sides, sides within a factor of two."""
        apart = math.dist(self.center_px, other.center_px)
        larger, smaller = max(self.side_px, other.side_px), min(self.side_px, other.side_px)
        return apart <= distance * larger and larger <= 2 * smaller

    def _image_from_pixel(self, size: int) -> np.ndarray:
        """(2, 3) affine map of pixel indices of a ``size`` crop to image coordinates."""
        A = self.R_image_crop * (self.side_px / size)
        return np.column_stack([A, np.asarray(self.center_px) + A @ np.full(2, 0.5 - size / 2)])


def _shrink(image: np.ndarray, A: np.ndarray, size: int, halvings: int) -> tuple[np.ndarray, np.ndarray]:
    """Halve what is under the square first, so that a large square is sampled without aliasing.

    Returns the smaller picture and the affine map onto it.
    """
    step = 1 << halvings
    height, width = image.shape[:2]
    corners = A @ np.array([[0, size, size, 0], [0, 0, size, size], [1, 1, 1, 1]], float)
    low = np.maximum(np.floor(corners.min(1)).astype(int) - step, 0)
    high = np.minimum(np.ceil(corners.max(1)).astype(int) + step, (width, height))
    columns, rows = ((high - low) // step).tolist()
    if columns < 1 or rows < 1:
        return image, A
    part = image[low[1] : low[1] + rows * step, low[0] : low[0] + columns * step]
    small = part
    for _ in range(halvings):
        small = halved(small)
    # the centre of small pixel i covers the pixels low + step·i … low + step·i + step − 1
    B = A / step
    B[:, 2] = (A[:, 2] - low - (step - 1) / 2) / step
    return small, B


def region_from_points(center_px: np.ndarray, top_px: np.ndarray) -> Region:
    """The region of a person: centred on the hips, ``top_px`` straight above in the crop.

    side = 2 · |top − center| · 1.25; the rotation makes center → top point up: atan2(dx, −dy). ``top_px`` lies on the
    circle about the hips that holds the whole person (MediaPipe's second detection point and auxiliary landmark).
    """
    dx, dy = (np.asarray(top_px, float) - np.asarray(center_px, float)).tolist()
    side = 2.0 * MARGIN * math.hypot(dx, dy)
    return Region((float(center_px[0]), float(center_px[1])), side, math.atan2(dx, -dy))


def bounds(points: np.ndarray) -> np.ndarray:
    """(4,) x0, y0, x1, y1 of the box about points (n, 2)."""
    return np.concatenate([points.min(axis=0), points.max(axis=0)])


def surroundings(points: np.ndarray) -> np.ndarray:
    """The same about a person's points, a tenth of its size larger on every side."""
    low, high = np.split(bounds(points), 2)
    margin = 0.1 * (high - low).max()
    return np.concatenate([low - margin, high + margin])


def inside(points: np.ndarray, boxes: Sequence[np.ndarray]) -> np.ndarray:
    """(n,) whether each point (n, 2) lies in one of the boxes."""
    found = np.zeros(len(points), bool)
    for box in boxes:
        found |= ((points >= box[:2]) & (points <= box[2:])).all(1)
    return found
