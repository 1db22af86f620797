# SPDX-License-Identifier: GPL-3.0-or-later
"""What a network looks at: the part of the picture in which people are looked for, fitted into its
input (letterboxing), or a rotated square, for landmarks.

Image coordinates are OpenCV's: the centre of the top left pixel is (0, 0), y runs down. Crop
coordinates s run from (0, 0) at the top left corner of the square to (1, 1) at its bottom right
one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import cv2
import numpy as np

from ...arrays import BoolArray, Float32Array, Float64Array, FloatArray, Uint8Array, round_number
from ...errors import UsageError

MARGIN = 1.25  # side of the square over the body circle's diameter
# To which centre and side, in pixels, and the rotation, in radians, are rounded.
STEP_PX = 2.0**-20
STEP_RAD = 2.0**-30
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


@dataclass(frozen=True)
class Region:
    """A square of ``side_px`` around ``center_px`` (x, y), rotated by ``rotation`` radians,
    clockwise on screen.

    All are rounded (`rounding`): a tracker finds each region from the keypoints in the one before
    and extrapolates its motion, so differences in the last bit would grow to pixels within two
    seconds.
    """

    center_px: tuple[float, float]
    side_px: float
    rotation: float

    def __post_init__(self) -> None:
        """Round the square."""
        x, y = self.center_px
        center = round_number(x, STEP_PX), round_number(y, STEP_PX)
        object.__setattr__(self, "center_px", center)
        object.__setattr__(self, "side_px", round_number(self.side_px, STEP_PX))
        object.__setattr__(self, "rotation", round_number(self.rotation, STEP_RAD))

    @property
    def R_image_crop(self) -> Float64Array:
        """(2, 2) rotation from the square's axes to the image's: [[c, −s], [s, c]]."""
        c = math.cos(self.rotation)
        s = math.sin(self.rotation)
        return np.array([[c, -s], [s, c]])

    def image_from_crop(self, points: Float64Array) -> Float64Array:
        """Convert crop coordinates (..., 2) to pixels: p = center + side · R · (s − ½)."""
        offset = self.side_px * (np.asarray(points) - 0.5) @ self.R_image_crop.T
        return np.asarray(self.center_px) + offset

    def crop_from_image(self, points: Float64Array) -> Float64Array:
        """Convert pixels (..., 2) to crop coordinates, the inverse of `image_from_crop`."""
        offset = np.asarray(points) - np.asarray(self.center_px)
        return offset @ self.R_image_crop / self.side_px + 0.5

    def image_from_pixels(self, size: int) -> Float64Array:
        """Return the affine map (2, 3) from the pixels of a crop (size, size) to the image's."""
        A = self.R_image_crop * (self.side_px / size)
        return np.column_stack([A, np.asarray(self.center_px) + A @ np.full(2, 0.5 - size / 2)])

    def cut(self, image_rgb: Uint8Array, size: int) -> Uint8Array:
        """Resample the square to (size, size, 3); outside the image (H, W, 3), its border pixels
        are repeated.

        A black border would cost the landmark networks 3 mm of accuracy on people at the edge.
        """
        A = self.image_from_pixels(size)
        source = image_rgb
        if self.side_px >= 2 * size:
            source, A = _shrink(image_rgb, A, size, int(self.side_px / size).bit_length() - 1)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        crop = cv2.warpAffine(source, A, (size, size), flags=flags, borderMode=cv2.BORDER_REPLICATE)
        return cast(Uint8Array, crop)

    def rotate_to_camera(self, vectors: Float64Array) -> Float64Array:
        """Rotate 3D vectors (..., 3) from the square's axes (x right, y down, z forward) to the
        camera's axes.
        """
        R_camera_crop = np.eye(3)
        R_camera_crop[:2, :2] = self.R_image_crop
        return np.asarray(vectors) @ R_camera_crop.T

    def moved(self, motion_px: FloatArray) -> Region:
        """Return the square moved by (2,) pixels."""
        x, y = np.asarray(self.center_px) + motion_px
        return replace(self, center_px=(x, y))

    def is_near(self, other: Region) -> bool:
        """Check if a person in one may occlude one in the other: centres within three quarters of a
        side.
        """
        return math.dist(self.center_px, other.center_px) <= 0.75 * max(self.side_px, other.side_px)

    def resembles(self, other: Region, distance: float) -> bool:
        """Check if both may show the same person: centres within ``distance`` sides, sides within a
        factor of two.
        """
        apart = math.dist(self.center_px, other.center_px)
        larger = max(self.side_px, other.side_px)
        smaller = min(self.side_px, other.side_px)
        return apart <= distance * larger and larger <= 2 * smaller

    def difference(self, other: Region) -> float:
        """Return the distance of the centres in sides of the larger square plus |log| of the ratio
        of the sides.
        """
        smaller, larger = sorted((max(self.side_px, 1e-9), max(other.side_px, 1e-9)))
        return math.dist(self.center_px, other.center_px) / larger + math.log(larger / smaller)


def _shrink(
    image: Uint8Array, A: Float64Array, size: int, halvings: int
) -> tuple[Uint8Array, Float64Array]:
    """Shrink the image under the square by powers of two, so that a large square is sampled without
    aliasing.

    :return: the smaller image, and the affine map onto it.
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
    # The centre of small pixel i covers the pixels low + step·i … low + step·i + step − 1.
    B = A / step
    B[:, 2] = (A[:, 2] - low - (step - 1) / 2) / step
    return small, B


def region_from_points(center_px: Float64Array, top_px: Float64Array) -> Region:
    """Calculate the region of a person, centred on the hips, with ``top_px`` straight above in the
    crop.

    side = 2 · |top − center| · 1.25; the rotation makes center → top point up.

    :param center_px: (2,) hip centre, pixels.
    :param top_px: (2,) on the circle around the hips that encloses the whole person (MediaPipe's
        second detection point and auxiliary landmark).
    """
    x, y = center_px
    up = top_px - center_px
    return Region((x, y), 2.0 * MARGIN * math.hypot(*up), rotation_towards(up))


def rotation_towards(up: FloatArray) -> float:
    """Calculate the rotation of a region in which the image direction ``up`` (2,) points up."""
    return math.atan2(up[0], -up[1])


def box_along(points: FloatArray, rotation: float) -> tuple[FloatArray, FloatArray]:
    """Calculate the centre (2,) and the sides (2,) of the box around points (n, 2) in the axes of a
    rotated region.
    """
    R_image_box = Region((0.0, 0.0), 1.0, rotation).R_image_crop
    along = points @ R_image_box
    low = along.min(axis=0)
    high = along.max(axis=0)
    return R_image_box @ ((low + high) / 2), high - low


def bounds(points: FloatArray) -> FloatArray:
    """Calculate the bounding box (4,) x0, y0, x1, y1 of points (n, 2)."""
    return np.concatenate([points.min(axis=0), points.max(axis=0)])


def surroundings(points: FloatArray) -> FloatArray:
    """Calculate the bounding box (4,) of a person's points (n, 2), with a margin of a tenth of its
    longer side.
    """
    low, high = np.split(bounds(points), 2)
    margin = 0.1 * (high - low).max()
    return np.concatenate([low - margin, high + margin])


def inside(points: FloatArray, boxes: Sequence[FloatArray]) -> BoolArray:
    """Check (n,) whether each point (n, 2) is in one of the boxes (4,) x0, y0, x1, y1."""
    found = np.zeros(len(points), bool)
    for box in boxes:
        found |= ((points >= box[:2]) & (points <= box[2:])).all(1)
    return found


MIN_SIDE_PX = 32  # of a part; in a smaller one nobody is found


def image_input(crop_rgb: Uint8Array) -> Float32Array:
    """Return a picture (H, W, 3) as most networks take it: (1, 3, H, W) in [0, 1]."""
    return cast(Float32Array, cv2.dnn.blobFromImage(crop_rgb, 1 / 255.0))


@dataclass(frozen=True)
class Crop:
    """A rectangle of the upright picture: its top left corner, width and height in pixels."""

    x: int
    y: int
    width: int
    height: int

    def cut(self, image_rgb: Uint8Array) -> Uint8Array:
        """Return this part of a picture (H, W, 3), as a view of its pixels."""
        return image_rgb[self.y : self.y + self.height, self.x : self.x + self.width]

    def check(self, width: int, height: int) -> None:
        """Check that the part lies within a picture of this size.

        :raises UsageError: it does not.
        """
        if self.x + self.width > width or self.y + self.height > height:
            raise UsageError(
                f"--crop {self} reaches beyond the footage, which has {width} x {height} pixels"
            )

    def __str__(self) -> str:
        """Write the part as the option has it."""
        return f"{self.x},{self.y},{self.width},{self.height}"


def parse_crop(text: str) -> Crop:
    """Parse "x,y,width,height" in pixels.

    :raises UsageError: the text is not four whole numbers, or the part is too small.
    """
    numbers = [number.strip() for number in text.split(",")]
    if len(numbers) != 4 or not all(re.fullmatch("[0-9]{1,6}", number) for number in numbers):
        raise UsageError(
            f"{text[:60]!r} is not a part of the picture: give x, y, width and height in pixels, "
            "such as 600,0,720,1080"
        )
    crop = Crop(*map(int, numbers))
    if min(crop.width, crop.height) < MIN_SIDE_PX:
        raise UsageError(f"--crop {crop} is too small: give at least {MIN_SIDE_PX} pixels a side")
    return crop
