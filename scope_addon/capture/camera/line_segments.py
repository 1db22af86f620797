# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight edges of a picture's background.

Source: line segments by von Gioi et al. 2010 (LSD).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...arrays import BoolArray, Float64Array, FloatArray, Uint8Array, unit_vectors
from ..perception.region import inside, surroundings
from .intrinsics import Camera

WORKING_SIDE_PX = 960
MIN_LENGTH = 0.03  # of the longer side
MAX_SEGMENTS = 250
BAR_MARGIN_PX = 6.0  # uncertainty of a bar's edge


@dataclass(frozen=True)
class Lines:
    """Straight lines as a camera sees them, the longest first."""

    normals: Float64Array  # (N, 3) of the planes that they span with the camera's centre
    lengths: Float64Array  # (N,) in sides of the picture

    @classmethod
    def none(cls) -> Lines:
        """Return no lines."""
        return cls(np.zeros((0, 3)), np.zeros(0))

    def rotated(self, R_new_camera: Float64Array) -> Lines:
        """Return the lines in other axes, those of ``R_new_camera`` (3, 3)."""
        return Lines(self.normals @ R_new_camera.T, self.lengths)

    def with_focal_scale(self, scale: float) -> Lines:
        """Return the lines of the same pixels with a focal length that is ``scale`` times as large.

        A ray (x, y, 1) becomes (x / s, y / s, 1), so a plane's normal becomes (s n_x, s n_y, n_z).
        """
        return Lines(unit_vectors(self.normals * [scale, scale, 1.0]), self.lengths)


@dataclass(frozen=True)
class Segments:
    """Straight edges in a picture, the longest first."""

    ends_px: Float64Array  # (N, 2, 2)
    lengths: Float64Array  # (N,) in sides of the picture

    @classmethod
    def none(cls) -> Segments:
        """Return no segments."""
        return cls(np.zeros((0, 2, 2)), np.zeros(0))

    @classmethod
    def of_all(cls, parts: Sequence[Segments]) -> Segments:
        """Return the segments of several pictures of one background."""
        ends = np.concatenate([part.ends_px for part in parts])
        lengths = np.concatenate([part.lengths for part in parts])
        order = np.argsort(-lengths, kind="stable")
        return cls(ends[order], lengths[order])

    def where(self, chosen: BoolArray) -> Segments:
        """Return some of the segments, those for which ``chosen`` (N,) is True."""
        return Segments(self.ends_px[chosen], self.lengths[chosen])

    def lines(self, camera: Camera) -> Lines:
        """Return the lines of the segments, in the camera's axes."""
        return Lines(plane_normals(camera.rays(self.ends_px)), self.lengths)


def plane_normals(rays: FloatArray) -> NDArray[Any]:
    """Return the (N, 3) unit normals of the planes through the camera's centre and each edge.

    :param rays: (N, 2, 3) directions to the ends of each edge.
    """
    return unit_vectors(np.cross(rays[:, 0], rays[:, 1]))


def find_segments(
    image_rgb: Uint8Array,
    people: Sequence[NDArray[Any]],
    working_side_px: int = WORKING_SIDE_PX,
    bars: Sequence[Float64Array] = (),
) -> Segments:
    """Find the straight edges of a picture's background.

    :param image_rgb: (H, W, 3).
    :param people: (n, 2) points of each person in pixels; edges inside their bounding boxes are
        left out.
    :param working_side_px: the longer side to which the picture is reduced; the time grows with its
        square.
    :param bars: (4,) each, see `bars`; their edges are left out.
    """
    height, width = image_rgb.shape[:2]
    scale = min(1.0, working_side_px / max(width, height))
    grey = cv2.cvtColor(image_rgb, cv2.COLOR_RGB2GRAY)
    if scale < 1.0:
        grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    found = cv2.createLineSegmentDetector().detect(grey)[0]
    if found is None:
        return Segments.none()
    ends = (found.reshape(-1, 2, 2) + 0.5) / scale - 0.5
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / max(width, height)
    keep = lengths > MIN_LENGTH
    middle = ends.mean(axis=1)
    margin = max(BAR_MARGIN_PX, 1.5 / scale) * np.array([-1, -1, 1, 1])
    keep &= ~inside(
        middle, [*(surroundings(points) for points in people), *(bar + margin for bar in bars)]
    )
    chosen = np.flatnonzero(keep)
    chosen = chosen[np.argsort(-lengths[chosen], kind="stable")[:MAX_SEGMENTS]]
    return Segments(ends[chosen].astype(float), lengths[chosen].astype(float))
