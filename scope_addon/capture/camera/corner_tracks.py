# SPDX-License-Identifier: GPL-3.0-or-later
"""Corners of the background, each followed for as long as it is seen: what tells how a camera
travels.

The rotation is estimated from one key frame at a time (`camera_rotation`); travel needs corners
that are known from several places. They are kept only in frames in which the picture has moved, so
a camera on a tripod leaves nothing to keep.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...arrays import BoolArray, Float32Array, Float64Array, IndexArray, Uint8Array, unit_vectors
from ..perception.region import inside
from .intrinsics import Camera

SAMPLES_HZ = 12.0  # hands tremble at up to 10 Hz, but by less than is visible here
STEP_S = 0.98 / SAMPLES_HZ  # from which on the next frame is followed
MAX_CORNERS = 220
REPLENISHED_SHARE = 0.75  # of that number; with fewer, new corners are looked for
SPACING_PX = 9  # between corners in the working image
QUALITY = 0.005  # of a corner, relative to the best one
MAX_RETURN_PX = 0.5  # between a corner and where it is found again when followed back
MOVED_PX = 1.5  # median displacement from which on the corners are kept again
# The same after some time: a slow camera would otherwise seem to move in steps.
SLOWLY_MOVED_PX = 0.4
SLOW_S = 0.5
# Sightings of a corner from which on it is known whether it is at rest: most of a second.
MIN_SIGHTINGS = 10
MIN_RESTING_SHARE = 0.8  # of such corners, where the camera does not travel


@dataclass(frozen=True)
class CornerTracks:
    """Corners that were seen n times altogether, in the order of the frames."""

    rows: IndexArray  # (n,) frames
    numbers: IndexArray  # (n,) of the corners; ascending within a frame
    points_px: Float32Array  # (n, 2) in the full image

    @classmethod
    def none(cls) -> CornerTracks:
        """Return the tracks of no corner."""
        return cls(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2), np.float32))

    def shifted(self, rows: int, numbers: int) -> CornerTracks:
        """Return the tracks with these numbers added to rows and corners."""
        return CornerTracks(self.rows + rows, self.numbers + numbers, self.points_px)

    @property
    def count(self) -> int:
        """One more than the largest number of a corner."""
        return int(self.numbers.max(initial=-1)) + 1


def corners_at_rest(
    corners: CornerTracks, R_first_camera: Float64Array, camera: Camera, tolerance: float
) -> Float64Array:
    """Return the (n, 3) directions, in the first frame's axes, of corners that a camera which only
    rotates sees at rest; none where many others move.

    :param R_first_camera: (T, 3, 3).
    :param tolerance: radians between a corner and its mean direction.
    """
    rays = unit_vectors(camera.rays(corners.points_px.astype(float)))
    seen = np.einsum("nij,nj->ni", R_first_camera[corners.rows], rays)
    count = np.bincount(corners.numbers, minlength=corners.count)
    total = np.zeros((corners.count, 3))
    np.add.at(total, corners.numbers, seen)
    mean = unit_vectors(total)
    off = np.zeros(corners.count)
    np.maximum.at(off, corners.numbers, np.linalg.norm(seen - mean[corners.numbers], axis=1))
    is_known = count >= MIN_SIGHTINGS
    rests = is_known & (off < tolerance)
    if rests.sum() < MIN_RESTING_SHARE * is_known.sum():
        return np.zeros((0, 3))
    return mean[rests]


def joined_corners(parts: Sequence[CornerTracks]) -> CornerTracks:
    """Return the tracks of windows that overlap; their rows and numbers are those of the clip.

    In the common frames, corners of both windows are seen, which links them.
    """
    rows = np.concatenate([part.rows for part in parts])
    numbers = np.concatenate([part.numbers for part in parts])
    points = np.concatenate([part.points_px for part in parts])
    order = np.lexsort((numbers, rows))
    return CornerTracks(rows[order], numbers[order], points[order])


class CornerFollower:
    """Follows corners through working images; these come in order."""

    def __init__(self) -> None:
        self._image: Uint8Array | None = None
        self._points: Float32Array = np.zeros((0, 2), np.float32)
        self._numbers: IndexArray = np.zeros(0, np.int64)
        self._next_number = 0
        self._kept_points: Float32Array = self._points
        self._kept_numbers: IndexArray = self._numbers
        self._kept_s = -np.inf
        self._kept: list[tuple[int, IndexArray, Float32Array]] = []

    def add(
        self,
        row: int,
        time_s: float,
        image: Uint8Array,
        boxes: Sequence[Float64Array],
        is_cut: bool,
        is_shared: bool = False,
    ) -> None:
        """Follow the corners to the next image.

        :param row: the number of the frame.
        :param image: (H, W) grey.
        :param boxes: (n, 4) what is not background: x0, y0, x1, y1 each, in pixels of the image.
        :param is_shared: whether the frame is kept in any case, because the corners of another
            window are kept in it: frames with corners of both windows link these.
        """
        if is_cut:
            self._points = self._points[:0]
            self._numbers = self._numbers[:0]
        if len(self._points):
            assert self._image is not None
            moved, good = follow_corners(self._image, image, self._points, boxes, MAX_RETURN_PX)
            self._points = moved[good]
            self._numbers = self._numbers[good]
        self._image = image
        is_short = len(self._points) < REPLENISHED_SHARE * MAX_CORNERS
        if is_shared or self._has_moved(time_s) or is_cut or not self._kept:
            if is_short:
                self._replenish(image, boxes)
            self._kept.append((row, self._numbers, self._points))
            self._kept_points = self._points
            self._kept_numbers = self._numbers
            self._kept_s = time_s

    def tracks(self, to_full: Callable[[Float32Array], Float32Array]) -> CornerTracks:
        """Return the corners so far.

        :param to_full: takes points (n, 2) of the working image to the full one.
        """
        if len(self._kept) < 2:
            return CornerTracks.none()
        rows = np.concatenate([np.full(len(numbers), row) for row, numbers, _ in self._kept])
        numbers = np.concatenate([numbers for _, numbers, _ in self._kept])
        points = np.concatenate([points for _, _, points in self._kept])
        return CornerTracks(rows.astype(np.int64), numbers, to_full(points).astype(np.float32))

    def _has_moved(self, time_s: float) -> bool:
        """Return whether the picture has moved since the corners were last kept, or lost many, or
        none were found then, as in a black frame.
        """
        if not len(self._kept_numbers):
            return True
        common = np.isin(self._numbers, self._kept_numbers, assume_unique=True)
        if common.sum() < 0.5 * len(self._kept_numbers):
            return True
        if not common.any():
            return False
        before = np.searchsorted(self._kept_numbers, self._numbers[common])
        steps = np.linalg.norm(self._points[common] - self._kept_points[before], axis=1)
        is_slow = time_s - self._kept_s >= SLOW_S
        return bool(np.median(steps) > (SLOWLY_MOVED_PX if is_slow else MOVED_PX))

    def _replenish(self, image: Uint8Array, boxes: Sequence[Float64Array]) -> None:
        mask = background_mask(image, boxes)
        for x, y in self._points:
            cv2.circle(mask, (round(float(x)), round(float(y))), SPACING_PX, (0,), -1)
        wanted = MAX_CORNERS - len(self._points)
        corners = cv2.goodFeaturesToTrack(image, wanted, QUALITY, SPACING_PX, mask=mask)
        if corners is None:
            return
        new = np.asarray(corners, np.float32).reshape(-1, 2)
        self._points = np.concatenate([self._points, new])
        numbers = np.arange(self._next_number, self._next_number + len(new))
        self._numbers = np.concatenate([self._numbers, numbers])
        self._next_number += len(new)


def background_mask(image: Uint8Array, boxes: Sequence[Float64Array]) -> Uint8Array:
    """Return an image (H, W) that is 0 within the boxes x0, y0, x1, y1 and 255 elsewhere."""
    mask = np.full(image.shape, 255, np.uint8)
    for x0, y0, x1, y1 in boxes:
        mask[max(0, int(y0)) : max(0, int(y1) + 1), max(0, int(x0)) : max(0, int(x1) + 1)] = 0
    return mask


def follow_corners(
    before: Uint8Array,
    after: Uint8Array,
    points: Float32Array,
    boxes: Sequence[Float64Array],
    max_return_px: float,
) -> tuple[Float32Array, BoolArray]:
    """Follow corners (n, 2) from one working image (H, W) to another, and back.

    :param boxes: (m, 4) what is not background: x0, y0, x1, y1 each, in pixels of the images.
    :param max_return_px: between a corner and where it is found when it is followed back.
    :return: positions (n, 2), and (n,) whether each was found, in the background.
    """
    moved, found = _flow(before, after, points)
    back, again = _flow(after, before, moved, near=points)
    height, width = after.shape
    good: BoolArray = found & again & (np.abs(back - points).max(axis=1) < max_return_px)
    good &= ((moved >= 0) & (moved < (width, height))).all(axis=1) & ~inside(moved, boxes)
    return moved, good


def _flow(
    before: Uint8Array, after: Uint8Array, points: Float32Array, near: Float32Array | None = None
) -> tuple[Float32Array, BoolArray]:
    """Follow corners (n, 2) from one working image to another (Lucas-Kanade).

    :param near: (n, 2) where to look for them, without an image pyramid.
    :return: positions (n, 2), and (n,) whether each was found.
    """
    start = points.astype(np.float32)
    guess, levels, flags = (
        (start, 3, 0)
        if near is None
        else (near.astype(np.float32), 0, cv2.OPTFLOW_USE_INITIAL_FLOW)
    )
    moved, found, _ = cv2.calcOpticalFlowPyrLK(
        before, after, start, guess.copy(), winSize=(15, 15), maxLevel=levels, flags=flags
    )
    return np.array(moved, np.float32), np.array(found).ravel() == 1
