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

# Edges of the background give a better estimate (focal_length.py) than what is assumed without any.
# Assuming 50 or 70 degrees for four cameras of 60 moved the person by 0.6 to 0.8 m in camera axes,
# but changed the error relative to the pelvis by 7 mm at most.


@dataclass(frozen=True)
class AssumedLens:
    """A field of view along the longer side, and the relative error of its focal length, one
    standard deviation.
    """

    fov_deg: float
    deviation: float


# Between a phone's main camera and a camera's standard lens (40 to 54 degrees): 48 to 74 degrees.
ANY_LENS = AssumedLens(60.0, 0.25)
# Whoever films upright holds a phone, whose main camera sees 58 to 70 degrees in videos, with and
# without the crop of its stabilization: 57 to 73 degrees.
PHONE_LENS = AssumedLens(65.0, 0.15)
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

    def between_bars(self, content: tuple[float, float], width: int, height: int) -> Camera:
        """Return the camera whose picture has this width and height, between bars of a frame."""
        share = max(content) / max(width, height)
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
    check_lens(focal_mm, fov_deg, calibration, camera_path)
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
        focal_px = focal_mm / FILM_WIDTH_MM * longer
        source = f"given, {focal_mm:g} mm"
    elif fov_deg is not None:
        focal_px = _focal_from_fov(longer, fov_deg)
        source = f"given, {fov_deg:g} degrees"
    elif metadata_focal_mm:
        focal_px = metadata_focal_mm / FILM_WIDTH_MM * longer
        source = f"the file's metadata, {metadata_focal_mm:g} mm"
    else:
        return assumed_camera(width, height, (width, height))
    return Camera(pinhole(width, height, focal_px), np.zeros(5), source, is_by_side=True)


def check_lens(
    focal_mm: float | None,
    fov_deg: float | None,
    calibration: Calibration | str | Path | None,
    camera_path: Path | None = None,
) -> None:
    """Check what the user says of the lens, as of `choose_camera`, without reading files.

    :raises UsageError: the values contradict each other, or one is impossible.
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
    if focal_mm is not None and not 1.0 <= focal_mm <= 2000.0:
        raise UsageError(
            f"--focal-mm {focal_mm:g} is not a focal length: give 35 mm equivalent ones, such as 26"
        )
    if fov_deg is not None and not 1.0 <= fov_deg <= 175.0:
        raise UsageError(
            f"--fov {fov_deg:g} is not a field of view: give degrees along the longer side, such "
            "as 60"
        )


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


def assumed_camera(width: int, height: int, content: tuple[float, float]) -> Camera:
    """Return the camera with the lens that is assumed where nothing is known of it.

    :param width, height: of the footage in pixels.
    :param content: width and height of the camera's image, which is smaller than the footage
        between bars.
    """
    content_width, content_height = content
    lens = PHONE_LENS if content_height > content_width else ANY_LENS
    source = f"assumed, {lens.fov_deg:g} degrees"
    longer_px = max(content)
    if longer_px < max(width, height):
        source += " between the bars"
    focal_px = _focal_from_fov(longer_px, lens.fov_deg)
    return Camera(pinhole(width, height, focal_px), np.zeros(5), source, lens.deviation)


def estimated_camera(
    width: int, height: int, focal_px: float, deviation: float, content: tuple[float, float]
) -> Camera:
    """Return the camera with an estimated focal length.

    :param width, height: of the footage in pixels.
    :param deviation: its relative error, one standard deviation.
    :param content: as for `assumed_camera`.
    """
    fov_deg = 2 * math.degrees(math.atan(max(content) / (2 * focal_px)))
    source = f"estimated, {fov_deg:.0f} degrees ± {100 * deviation:.0f} %"
    intrinsics = pinhole(width, height, round_number(focal_px, FOCAL_STEP_PX))
    return Camera(intrinsics, np.zeros(5), source, deviation)


def _focal_from_fov(longer: float, fov_deg: float) -> float:
    return longer / (2 * math.tan(math.radians(fov_deg) / 2))
