# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight edges of a picture's background.

Source: line segments by von Gioi et al. 2010 (LSD).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..perception.region import inside, surroundings
from .intrinsics import Camera

WORKING_SIDE_PX = 960
SHORTEST = 0.03  # of the longer side
MOST_SEGMENTS = 250
BAR_MARGIN_PX = 6.0  # by which the edge of a bar may be off


@dataclass(frozen=True)
class Lines:
    """Straight lines as a camera sees them, the longest first."""

    normals: np.ndarray  # (N, 3) of the planes that they span with the camera's centre
    lengths: np.ndarray  # (N,) in sides of the picture

    @classmethod
    def none(cls) -> Lines:
        """Nothing is known."""
        return cls(np.zeros((0, 3)), np.zeros(0))

    def turned(self, R_new_camera: np.ndarray) -> Lines:
        """The same in other axes."""
        return Lines(self.normals @ R_new_camera.T, self.lengths)


@dataclass(frozen=True)
class Segments:
    """Straight edges in a picture, the longest first."""

    ends_px: np.ndarray  # (N, 2, 2)
    lengths: np.ndarray  # (N,) in sides of the picture

    @classmethod
    def none(cls) -> Segments:
        """Nothing was found."""
        return cls(np.zeros((0, 2, 2)), np.zeros(0))

    def lines(self, camera: Camera) -> Lines:
        """What they are to a camera, in its frame."""
        return Lines(plane_normals(camera.rays(self.ends_px)), self.lengths)


def plane_normals(rays: np.ndarray) -> np.ndarray:
    """(N, 3) unit normals of the planes through the camera's centre that hold both rays (N, 2, 3) to an edge's ends."""
    normals = np.cross(rays[:, 0], rays[:, 1])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def find_segments(
    image_rgb: np.ndarray,
    people: Sequence[np.ndarray],
    working_side_px: int = WORKING_SIDE_PX,
    bars: Sequence[np.ndarray] = (),
) -> Segments:
    """The straight edges of a picture.

    :param people: (n, 2) points of each person in pixels; edges within their boxes are left out.
    :param bars: see `bars`; their edges are left out.
    :param working_side_px: the longer side of the picture that is looked at; the time it takes grows with its square.
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
    keep = lengths > SHORTEST
    middle = ends.mean(axis=1)
    margin = max(BAR_MARGIN_PX, 1.5 / scale) * np.array([-1, -1, 1, 1])
    keep &= ~inside(middle, [*(surroundings(points) for points in people), *(bar + margin for bar in bars)])
    chosen = np.flatnonzero(keep)
    chosen = chosen[np.argsort(-lengths[chosen])[:MOST_SEGMENTS]]
    return Segments(ends[chosen].astype(float), lengths[chosen].astype(float))
