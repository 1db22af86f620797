# SPDX-License-Identifier: GPL-3.0-or-later
"""The view of a picture: the footage's own camera, cropped to the person, or a virtual camera
elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.motion import Motion

_FAR = 14.0  # distance of the virtual camera in metres, so that there is little perspective


@dataclass(frozen=True)
class View:
    """A pinhole camera in the motion's world (z up): K in pixels of a picture of ``size`` (width,
    height).
    """

    intrinsics: NDArray[np.float64]
    world_from_camera: NDArray[np.float64]
    size: tuple[int, int]

    def to_camera(self, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform points (..., 3) to the camera frame, metres, OpenCV's axes."""
        R = self.world_from_camera[:3, :3]
        t = self.world_from_camera[:3, 3]
        return (points_world - t) @ R

    def project(self, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Project points (..., 3) to pixels (..., 2); NaN behind the camera."""
        points = self.to_camera(np.asarray(points_world, float))
        depth = np.where(points[..., 2:] > 0.1, points[..., 2:], np.nan)
        return (points / depth @ self.intrinsics.T)[..., :2]


def from_the_camera(
    motion: Motion, row: int, points_world: NDArray[np.float64], size: tuple[int, int], fill: float
) -> View:
    """Return the footage's camera at a row of the motion, cropped so that the points take ``fill``
    of the height.
    """
    whole = View(motion.intrinsics, motion.world_from_camera[row], size)
    pixels = whole.project(points_world)
    low = pixels.min(0)
    high = pixels.max(0)
    scale = min(fill * size[1] / (high[1] - low[1]), fill * size[0] / (high[0] - low[0]))
    crop = np.array([[scale, 0, size[0] / 2], [0, scale, size[1] / 2], [0, 0, 1.0]])
    crop[:2, 2] -= scale * (low + high) / 2
    return View(crop @ motion.intrinsics, whole.world_from_camera, size)


def from_around(
    motion: Motion,
    row: int,
    center: NDArray[np.float64],
    size: tuple[int, int],
    turn: float,
    height: float,
    pitch: float = 7.0,
) -> View:
    """Return a camera that looks at ``center`` from far away.

    :param turn: degrees around the vertical, away from the footage's camera; 90 sees the person
        from that camera's right, -90 from its left.
    :param height: metres that fill the picture's height at the center.
    :param pitch: degrees by which it looks down.
    """
    toward = motion.world_from_camera[row, :3, 2] * [1, 1, 0]
    toward = toward / np.linalg.norm(toward)
    a = np.radians(turn)
    p = np.radians(pitch)
    toward = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]) @ toward
    forward = np.cos(p) * toward - np.sin(p) * np.array([0, 0, 1.0])
    T = level_camera(center - _FAR * forward, forward)
    focal = size[1] * _FAR / height
    return View(np.array([[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1.0]]), T, size)


def level_camera(eye: NDArray[np.float64], forward: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return world_from_camera (4, 4) of a level camera at eye (3,) that looks along a unit vector
    (3,), z up.
    """
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    T_world_camera[:3, 3] = eye
    return T_world_camera
