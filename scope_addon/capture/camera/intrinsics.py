# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's intrinsics: from the user, from the file, or the most likely ones for a phone or a camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import UsageError
from .calibration import read_calibration

# Without any better knowledge: a field of view of 60 degrees along the longer side, between a phone's main camera
# (65-70 degrees, less the crop of its video stabilization) and a camera's standard lens (40-54 degrees).
# Where the background has edges, these tell more (focal_length.py). The body says a little (focal_fits.py), for it
# leans on the lifted points, and these on the assumed focal length: in 19 clips of known focal length (four calibrated
# cameras, of 59.4 to 60.1 degrees, fifteen renders) the default is off by 0.33 (root mean square of the logarithm),
# both together by 0.30; renders 0.33 instead of 0.37, cameras 0.06 instead of 0.01. Assuming 50 or 70 degrees for these
# put the person 0.6 to 0.8 m wrong in the camera frame, but changed the error relative to the pelvis by 7 mm at most.
DEFAULT_FOV_DEG = 60.0
ASSUMED_DEVIATION = 0.25  # relative error of the default, one standard deviation: 48 to 74 degrees
FILM_WIDTH_MM = 36.0  # "35 mm equivalent" focal lengths refer to this width along the longer side


@dataclass(frozen=True)
class Camera:
    """Pinhole intrinsics (pixels of the decoded, upright frame) and OpenCV distortion, with where they came from."""

    intrinsics: np.ndarray  # (3, 3)
    dist: np.ndarray  # (5,)
    source: str  # said in the report
    focal_deviation: float = 0.0  # relative error of the focal length, one standard deviation; 0: given

    def undistort(self, points_px: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) as an ideal pinhole with the same intrinsics would see them."""
        if not self.dist.any() or not points_px.size:  # OpenCV refuses to undistort nothing
            return points_px
        import cv2

        flat = np.ascontiguousarray(points_px, float).reshape(-1, 1, 2)
        return cv2.undistortPoints(flat, self.intrinsics, self.dist, P=self.intrinsics).reshape(points_px.shape)

    def rays(self, points_px: np.ndarray) -> np.ndarray:
        """(..., 3) directions with z = 1, camera frame, in which pixels (..., 2) were seen."""
        K = self.intrinsics
        flat = (self.undistort(points_px) - K[:2, 2]) / [K[0, 0], K[1, 1]]
        return np.concatenate([flat, np.ones((*flat.shape[:-1], 1))], axis=-1)


def pinhole(width: int, height: int, focal_px: float) -> np.ndarray:
    """(3, 3) intrinsics with square pixels and the principal point in the middle."""
    return np.array([[focal_px, 0.0, width / 2], [0.0, focal_px, height / 2], [0.0, 0.0, 1.0]])


def scaled_intrinsics(intrinsics: np.ndarray, scale: float) -> np.ndarray:
    """(3, 3) of the same picture made smaller or larger; pixel centres are whole numbers, its corner is at -1/2."""
    return np.array([[scale, 0, (scale - 1) / 2], [0, scale, (scale - 1) / 2], [0, 0, 1]]) @ intrinsics


def choose_camera(
    width: int,
    height: int,
    *,
    focal_mm: float | None = None,
    fov_deg: float | None = None,
    calibration: str | Path | None = None,
    metadata_focal_mm: float | None = None,
) -> Camera:
    """The best known camera for footage of this size: the user's word first, then the file's, then the default.

    :param focal_mm: 35 mm equivalent focal length along the longer side, f_px = f_mm / 36 · max(width, height).
    :param fov_deg: field of view along the longer side, f_px = max(width, height) / (2 tan(fov / 2)).
    :param calibration: JSON file; see `calibration`.
    :param metadata_focal_mm: as ``focal_mm``, from the file's own metadata.
    :raises UsageError: more than one of the user's ways at once, or an impossible value.
    :raises InputError: the calibration cannot be used for footage of this size.
    """
    ways = {"--focal-mm": focal_mm, "--fov": fov_deg, "--calibration": calibration}
    given = [name for name, value in ways.items() if value is not None]
    if len(given) > 1:
        raise UsageError(f"{' and '.join(given)} contradict each other: give one of them")
    longer = max(width, height)
    if calibration is not None:
        known = read_calibration(Path(calibration))
        return Camera(known.intrinsics_for(width, height), known.dist, f"calibration {known.path.name}")
    if focal_mm is not None:
        if not 1.0 <= focal_mm <= 2000.0:
            raise UsageError(f"--focal-mm {focal_mm:g} is not a focal length: give 35 mm equivalent ones, such as 26")
        return Camera(pinhole(width, height, focal_mm / FILM_WIDTH_MM * longer), np.zeros(5), f"given, {focal_mm:g} mm")
    if fov_deg is not None:
        if not 1.0 <= fov_deg <= 175.0:
            raise UsageError(f"--fov {fov_deg:g} is not a field of view: give degrees along the longer side, say 60")
        focal_px = _focal_from_fov(longer, fov_deg)
        return Camera(pinhole(width, height, focal_px), np.zeros(5), f"given, {fov_deg:g} degrees")
    if metadata_focal_mm:
        focal_px = metadata_focal_mm / FILM_WIDTH_MM * longer
        return Camera(pinhole(width, height, focal_px), np.zeros(5), f"the file's metadata, {metadata_focal_mm:g} mm")
    return assumed_camera(width, height, longer)


def assumed_camera(width: int, height: int, longer_px: float) -> Camera:
    """The most likely camera; ``longer_px``: the longer side of what it saw, less than the picture's between bars."""
    source = f"assumed, {DEFAULT_FOV_DEG:g} degrees"
    if longer_px < max(width, height):
        source += " between the bars"
    focal_px = _focal_from_fov(longer_px, DEFAULT_FOV_DEG)
    return Camera(pinhole(width, height, focal_px), np.zeros(5), source, ASSUMED_DEVIATION)


def estimated_camera(width: int, height: int, focal_px: float, deviation: float, longer_px: float) -> Camera:
    """The camera with a focal length told by the background's edges, ``deviation`` its relative error.

    ``longer_px``: as for `assumed_camera`.
    """
    fov_deg = 2 * math.degrees(math.atan(longer_px / (2 * focal_px)))
    source = f"estimated, {fov_deg:.0f} degrees ± {100 * deviation:.0f} %"
    return Camera(pinhole(width, height, focal_px), np.zeros(5), source, deviation)


def _focal_from_fov(longer: float, fov_deg: float) -> float:
    return longer / (2 * math.tan(math.radians(fov_deg) / 2))
