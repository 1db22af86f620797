# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's intrinsics: given by the user, from the file's metadata, or assumed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from ...arrays import Float64Array, FloatArray, round_number
from ...errors import UsageError
from ...footage import display_text
from ...footage_view import AS_IN_FILE, FootageView
from .calibration import Calibration, read_calibration
from .given_path import read_camera_path

# The default is a field of view of 60 degrees along the longer side, between a phone's main camera
# (65-70 degrees, less the crop of its video stabilization) and a camera's standard lens (40-54
# degrees). Edges of the background give a better estimate, and the body adds little
# (focal_length.py), because it depends on the lifted points, and these on the assumed focal length.
# In 19 clips of known focal length (four calibrated cameras of 59.4 to 60.1 degrees, fifteen
# renders) the root mean square error of its logarithm is 0.33 by default, and 0.30 with both
# estimates: for the renders 0.33 instead of 0.37, for the cameras 0.06 instead of 0.01. Assuming 50
# or 70 degrees for the cameras moved the person by 0.6 to 0.8 m in camera axes, but changed the
# error relative to the pelvis by 7 mm at most.
DEFAULT_FOV_DEG = 60.0
ASSUMED_DEVIATION = 0.25  # relative error of the default, one standard deviation: 48 to 74 degrees
FOCAL_STEP_PX = 2.0**-6  # to which estimates are rounded
FILM_WIDTH_MM = 36.0  # "35 mm equivalent" focal lengths refer to this width along the longer side


@dataclass(frozen=True)
class Camera:
    """Pinhole intrinsics (pixels of the decoded, upright frame) and OpenCV distortion, and their
    source.
    """

    intrinsics: Float64Array  # (3, 3)
    dist: Float64Array  # (5,)
    source: str  # as the report gives it
    # Relative error of the focal length, one standard deviation; 0: given.
    focal_deviation: float = 0.0
    # Whether the focal length was given against the longer side of the picture, which is that of
    # the frame as long as no bars are known.
    is_by_side: bool = False

    def undistort(self, points_px: FloatArray) -> FloatArray:
        """Return pixels (..., 2) as an ideal pinhole camera with the same intrinsics would see
        them.
        """
        if not self.dist.any() or not points_px.size:  # OpenCV raises an error for no points
            return points_px
        import cv2

        flat = np.ascontiguousarray(points_px, float).reshape(-1, 1, 2)
        undistorted = cv2.undistortPoints(flat, self.intrinsics, self.dist, P=self.intrinsics)
        return cast(FloatArray, undistorted.reshape(points_px.shape))

    def zoomed(self, zoom: float) -> Camera:
        """Return the camera with ``zoom`` times the focal length."""
        return replace(self, intrinsics=self.intrinsics @ np.diag([zoom, zoom, 1.0]))

    def between_bars(self, longer_px: float, width: int, height: int) -> Camera:
        """Return the camera whose picture has this longer side, between bars of a frame."""
        share = longer_px / max(width, height)
        if not self.is_by_side or share >= 1.0:
            return self
        return replace(self.zoomed(share), source=f"{self.source} between the bars")

    def at_zoom(self, points_px: FloatArray, zoom: FloatArray | float) -> FloatArray:
        """Return where pixels (..., 2) are with ``zoom`` times the focal length."""
        center = self.intrinsics[:2, 2]
        return center + zoom * (points_px - center)

    def rays(self, points_px: FloatArray) -> Float64Array:
        """Return the (..., 3) lines of sight of pixels (..., 2), in camera axes, with z = 1."""
        K = self.intrinsics
        flat = (self.undistort(points_px) - K[:2, 2]) / [K[0, 0], K[1, 1]]
        return np.concatenate([flat, np.ones((*flat.shape[:-1], 1))], axis=-1)


def pinhole(width: int, height: int, focal_px: float) -> Float64Array:
    """Return (3, 3) intrinsics with square pixels and the principal point in the middle of the
    image.
    """
    return np.array([[focal_px, 0.0, width / 2], [0.0, focal_px, height / 2], [0.0, 0.0, 1.0]])


def scaled_intrinsics(intrinsics: Float64Array, scale: float) -> Float64Array:
    """Return the intrinsics (3, 3) of a scaled image; pixel centres have integer coordinates, the
    corner is at -1/2.
    """
    scaling = np.array([[scale, 0, (scale - 1) / 2], [0, scale, (scale - 1) / 2], [0, 0, 1]])
    return scaling @ intrinsics


def choose_camera(
    width: int,
    height: int,
    *,
    focal_mm: float | None = None,
    fov_deg: float | None = None,
    calibration: Calibration | str | Path | None = None,
    camera_path: Path | None = None,
    metadata_focal_mm: float | None = None,
    view: FootageView = AS_IN_FILE,
) -> Camera:
    """Choose the camera for footage of this size: from the user, otherwise the metadata, otherwise
    the default.

    :param width, height: of the footage in pixels.
    :param focal_mm: 35 mm equivalent focal length along the longer side, f_px = f_mm / 36 ·
        max(width, height).
    :param fov_deg: field of view along the longer side, f_px = max(width, height) / (2 tan(fov /
        2)).
    :param camera_path: a file with the lens and the path of a camera.
    :param metadata_focal_mm: as ``focal_mm``, from the file's own metadata.
    :param view: how the footage was turned; a calibration is for the frames as they were before.
    :raises UsageError: the user's values contradict each other, or one is impossible.
    :raises InputError: the calibration, or that of the path, cannot be used for footage of this
        size.
    """
    options = {
        "--focal-mm": focal_mm,
        "--fov": fov_deg,
        "--calibration": calibration,
        "--camera-path": camera_path,
    }
    given = [name for name, value in options.items() if value is not None]
    if len(given) > 1:
        raise UsageError(f"{' and '.join(given)} contradict each other: give one of them")
    longer = max(width, height)
    lens = _lens_of_file(calibration, camera_path)
    if lens is not None:
        known, source = lens
        size = view.size(width, height)
        return Camera(
            view.intrinsics(known.intrinsics_for(*size), *size),
            view.distortion(known.dist),
            source,
        )
    if focal_mm is not None:
        if not 1.0 <= focal_mm <= 2000.0:
            raise UsageError(
                f"--focal-mm {focal_mm:g} is not a focal length: give 35 mm "
                "equivalent ones, such as 26"
            )
        focal_px = focal_mm / FILM_WIDTH_MM * longer
        source = f"given, {focal_mm:g} mm"
    elif fov_deg is not None:
        if not 1.0 <= fov_deg <= 175.0:
            raise UsageError(
                f"--fov {fov_deg:g} is not a field of view: give degrees along the longer side, "
                "such as 60"
            )
        focal_px = _focal_from_fov(longer, fov_deg)
        source = f"given, {fov_deg:g} degrees"
    elif metadata_focal_mm:
        focal_px = metadata_focal_mm / FILM_WIDTH_MM * longer
        source = f"the file's metadata, {metadata_focal_mm:g} mm"
    else:
        return assumed_camera(width, height, longer)
    return Camera(pinhole(width, height, focal_px), np.zeros(5), source, is_by_side=True)


def _lens_of_file(
    calibration: Calibration | str | Path | None, camera_path: Path | None
) -> tuple[Calibration, str] | None:
    """Return the calibration that one of two files holds, and its source; None without a file."""
    if calibration is not None:
        if not isinstance(calibration, Calibration):
            calibration = read_calibration(Path(calibration))
        return calibration, f"calibration {display_text(calibration.path.name)}"
    if camera_path is not None:
        name = display_text(camera_path.name)
        return read_camera_path(camera_path).calibration, f"camera path {name}"
    return None


def assumed_camera(width: int, height: int, longer_px: float) -> Camera:
    """Return the camera with the default field of view.

    :param width, height: of the footage in pixels.
    :param longer_px: the longer side of the camera's image, which is smaller than the footage's
        between bars.
    """
    source = f"assumed, {DEFAULT_FOV_DEG:g} degrees"
    if longer_px < max(width, height):
        source += " between the bars"
    focal_px = _focal_from_fov(longer_px, DEFAULT_FOV_DEG)
    return Camera(pinhole(width, height, focal_px), np.zeros(5), source, ASSUMED_DEVIATION)


def estimated_camera(
    width: int, height: int, focal_px: float, deviation: float, longer_px: float
) -> Camera:
    """Return the camera with an estimated focal length.

    :param width, height: of the footage in pixels.
    :param deviation: its relative error, one standard deviation.
    :param longer_px: as for `assumed_camera`.
    """
    fov_deg = 2 * math.degrees(math.atan(longer_px / (2 * focal_px)))
    source = f"estimated, {fov_deg:.0f} degrees ± {100 * deviation:.0f} %"
    intrinsics = pinhole(width, height, round_number(focal_px, FOCAL_STEP_PX))
    return Camera(intrinsics, np.zeros(5), source, deviation)


def _focal_from_fov(longer: float, fov_deg: float) -> float:
    return longer / (2 * math.tan(math.radians(fov_deg) / 2))
