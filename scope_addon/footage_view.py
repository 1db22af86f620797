# SPDX-License-Identifier: GPL-3.0-or-later
"""How footage has to be turned and mirrored to show what the camera saw, where its file does not
say so.

A picture of W × H pixels is turned clockwise by quarter turns, then mirrored left to right. Pixel
centres have integer coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Float64Array, Uint8Array


@dataclass(frozen=True)
class FootageView:
    """A turn by ``clockwise_deg``, a multiple of 90, and then, if ``is_mirrored``, left and right
    exchanged.
    """

    clockwise_deg: int = 0
    is_mirrored: bool = False

    @property
    def is_upright(self) -> bool:
        """Whether the picture keeps its width and height."""
        return self.clockwise_deg % 180 == 0

    def show(self, image_rgb: Uint8Array) -> Uint8Array:
        """Return a picture (H, W, 3) turned and mirrored; the picture itself if nothing changes."""
        shown = image_rgb
        if self.clockwise_deg:
            shown = np.rot90(shown, -self.clockwise_deg // 90)
        if self.is_mirrored:
            shown = shown[:, ::-1]
        return np.ascontiguousarray(shown)

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Return width and height of the shown picture, of those of the file's; and reversely."""
        return (width, height) if self.is_upright else (height, width)

    def intrinsics(self, intrinsics: Float64Array, width: int, height: int) -> Float64Array:
        """Return the (3, 3) intrinsics without skew of the shown picture.

        :param intrinsics: of the file's picture.
        :param width, height: of the file's picture.
        """
        fx, fy, cx, cy = intrinsics[[0, 1, 0, 1], [0, 1, 2, 2]]
        for _ in range(self.clockwise_deg // 90):
            fx, fy = fy, fx
            cx, cy = height - 1 - cy, cx
            width, height = height, width
        if self.is_mirrored:
            cx = width - 1 - cx
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    def distortion(self, dist: Float64Array) -> Float64Array:
        """Return OpenCV's (5,) k1, k2, p1, p2, k3 in the shown picture, of those in the file's.

        Only the tangential part changes: a quarter turn takes (p1, p2) to (p2, −p1), and mirroring
        to (p1, −p2).
        """
        k1, k2, p1, p2, k3 = dist
        for _ in range(self.clockwise_deg // 90):
            p1, p2 = p2, -p1
        if self.is_mirrored:
            p2 = -p2
        return np.array([k1, k2, p1, p2, k3])

    @property
    def axes(self) -> Float64Array:
        """(3, 3) rotation from the axes of the camera to those of one that was turned as the
        picture is; without mirroring.
        """
        quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        return np.linalg.matrix_power(quarter, self.clockwise_deg // 90)

    def then(self, later: FootageView) -> FootageView:
        """Return the view that shows a picture as this one does, and that as ``later`` does."""
        turn = -later.clockwise_deg if self.is_mirrored else later.clockwise_deg
        return FootageView((self.clockwise_deg + turn) % 360, self.is_mirrored != later.is_mirrored)

    @property
    def inverse(self) -> FootageView:
        """The view that takes the shown picture to the file's; mirroring is its own inverse, and
        reverses a turn.
        """
        if self.is_mirrored:
            return self
        return FootageView(-self.clockwise_deg % 360)


AS_IN_FILE = FootageView()


def scaled_size(width: int, height: int, longer_side: float) -> tuple[float, tuple[int, int]]:
    """Return the scale with which a picture has this longer side, and its width and height then."""
    scale = longer_side / max(width, height)
    return scale, (max(1, round(width * scale)), max(1, round(height * scale)))
