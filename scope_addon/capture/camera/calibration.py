# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's camera calibration: a JSON file with OpenCV's camera matrix and distortion, for footage of any size.

    {"intrinsics": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], "dist": [k1, k2, p1, p2, k3], "size": [width, height]}

Nothing in it that tells of the lens is ignored: what cannot be meant is refused, because a wrong lens looks like a
wrong person. Other keys, such as a name or a date, do no harm.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....solver.errors import InputError

# The name in our files, and what OpenCV's examples and other programs call the same.
_NAMES = {
    "intrinsics": ("intrinsics", "camera_matrix", "K"),
    "dist": ("dist", "dist_coeffs", "distortion", "distortion_coefficients"),
    "size": ("size", "image_size"),
}
# Keys of other names that say something of the lens or the picture, by words in them or as a whole.
_OF_THE_LENS = re.compile(
    r".*(dist|coef|matrix|intrin|skew|fish|model|focal|resolution|size|width|height).*|[kp]_?\d|f_?[xy]?|c_?[xy]|[wh]",
    re.I | re.S,
)
_OPENCV_COUNTS = (0, 4, 5, 8, 12, 14)
_BROWN = 5  # k1, k2, p1, p2, k3: what a motion file holds
_FOCAL_RANGE = (0.01, 100.0)  # in longer sides of the picture: fields of view of 178 and 0.6 degrees
_LARGEST_PIXEL_ASPECT = 4.0
_FARTHEST = 10.0  # tangent of the angle, 84 degrees, by which the picture's middle may lie off the optical axis
_LARGEST_TANGENTIAL = 0.5
_LARGEST_MAGNIFICATION = 3.0  # that distortion may make at half the shorter side
_LARGEST_SKEW = 1e-3  # of the focal length; less than a pixel at the picture's edge
_LARGEST_SIDE = 1e6
_ONE_PIXEL = 1.0  # by which a size may be rounded


@dataclass(frozen=True)
class Calibration:
    """What the file says. ``size`` is (width, height) of the pictures it was made with, None: not said."""

    path: Path
    intrinsics: np.ndarray  # (3, 3)
    dist: np.ndarray  # (5,) OpenCV's k1, k2, p1, p2, k3
    size: tuple[float, float] | None

    def intrinsics_for(self, width: int, height: int) -> np.ndarray:
        """(3, 3) in pixels of footage of this size.

        :raises InputError: the footage shows another part of the world than the pictures of the calibration.
        """
        K = self.intrinsics
        if self.size is None:
            if not (0 <= K[0, 2] <= width and 0 <= K[1, 2] <= height):
                raise InputError(
                    f"{self.path}: the principal point ({K[0, 2]:g}, {K[1, 2]:g}) lies outside of the footage, which "
                    f'has {width} x {height} pixels; add "size": [width, height] of the pictures it was calibrated with'
                )
            known_width, known_height = float(width), float(height)
        else:
            known_width, known_height = self.size
        if not _same_proportions((known_width, known_height), (width, height)):
            raise InputError(
                f"{self.path} is for pictures of {known_width:g} x {known_height:g}, the footage has {width} x {height}"
                f" pixels, which are other proportions; {_what_to_do(known_width, known_height, width, height)}"
            )
        longer = max(known_width, known_height)
        if not all(_FOCAL_RANGE[0] * longer <= K[i, i] <= _FOCAL_RANGE[1] * longer for i in (0, 1)):
            raise InputError(
                f"{self.path}: no lens has focal lengths of {K[0, 0]:g} and {K[1, 1]:g} pixels in pictures of "
                f"{known_width:g} x {known_height:g}; give them in pixels, and the size they belong to"
            )
        if not 1 / _LARGEST_PIXEL_ASPECT <= K[0, 0] / K[1, 1] <= _LARGEST_PIXEL_ASPECT:
            raise InputError(f"{self.path}: focal lengths of {K[0, 0]:g} and {K[1, 1]:g} pixels do not go together")
        off_axis = (np.array([known_width, known_height]) / 2 - K[:2, 2]) / K[[0, 1], [0, 1]]
        if np.abs(off_axis).max() > _FARTHEST:
            raise InputError(
                f"{self.path}: the principal point ({K[0, 2]:g}, {K[1, 2]:g}) is too far from pictures of "
                f"{known_width:g} x {known_height:g}; give it in pixels from their top left corner"
            )
        if not _can_be_undistorted(self.dist, min(known_width, known_height) / (K[0, 0] + K[1, 1])):
            raise InputError(
                f"{self.path}: dist {self.dist.tolist()} folds or tears the picture; give OpenCV's k1, k2, p1, p2, k3, "
                "in this order, that belong to these intrinsics"
            )
        return np.diag([width / known_width, height / known_height, 1.0]) @ K


def read_calibration(path: Path) -> Calibration:
    """The calibration in a JSON file.

    :raises InputError: it cannot be read, or holds something that cannot be meant.
    """
    try:
        data = json.loads(path.read_text("utf-8-sig"))
    except OSError as error:
        raise InputError(f"cannot read the calibration {path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not a calibration: it is no JSON file; {_wanted()}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path} is not a calibration: it holds no JSON object; {_wanted()}")
    values = _by_our_names(path, data)
    if "intrinsics" not in values:
        raise InputError(f'{path} is not a calibration: it has no "intrinsics"; {_wanted()}')
    intrinsics = _intrinsics(path, values["intrinsics"])
    return Calibration(path, intrinsics, _distortion(path, values.get("dist")), _size(path, values.get("size")))


def _wanted() -> str:
    return 'write {"intrinsics": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], "dist": [k1, k2, p1, p2, k3], "size": [w, h]}'


def _by_our_names(path: Path, data: dict) -> dict[str, Any]:
    values: dict[str, Any] = {}
    ours = {name: key for key, names in _NAMES.items() for name in names}
    for name, value in data.items():
        if name not in ours:
            if _OF_THE_LENS.fullmatch(name):
                known = ", ".join(name for names in _NAMES.values() for name in names)
                raise InputError(f"{path}: {name[:80]!r} is not known; say it with one of {known}, or leave it out")
            continue
        if ours[name] in values:
            twice = " and ".join(n for n in data if n in _NAMES[ours[name]])
            raise InputError(f"{path} says the same twice, as {twice}; leave one of them out")
        values[ours[name]] = value
    return values


def _numbers(value: Any) -> np.ndarray | None:
    """An array of finite numbers of any shape, None where the value is something else."""
    try:
        array = np.asarray(value, float)
    except (ValueError, TypeError, OverflowError):
        return None
    return array if np.isfinite(array).all() else None


def _intrinsics(path: Path, value: Any) -> np.ndarray:
    K = _numbers(value)
    if K is None or K.shape != (3, 3):
        raise InputError(f"{path}: intrinsics must be three rows of three numbers; {_wanted()}")
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        raise InputError(f"{path}: intrinsics have focal lengths {K[0, 0]:g} and {K[1, 1]:g}, which must be above 0")
    if np.array_equal(K[:, 2], [0, 0, 1]) and K[2, :2].any():
        raise InputError(f"{path}: intrinsics are transposed; write rows, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
    if K[1, 0] != 0 or not np.array_equal(K[2], [0, 0, 1]):
        raise InputError(f"{path}: intrinsics must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], but are {K.tolist()}")
    if abs(K[0, 1]) > _LARGEST_SKEW * K[0, 0]:
        raise InputError(f"{path}: intrinsics have a skew of {K[0, 1]:g}; calibrate without one, as OpenCV does")
    K[0, 1] = 0.0
    return K


def _distortion(path: Path, value: Any) -> np.ndarray:
    if value is None:
        return np.zeros(_BROWN)
    dist = _numbers(value)
    if dist is None or max(dist.shape, default=0) != dist.size:  # a row or a column, as OpenCV writes it
        raise InputError(f"{path}: dist must be a list of numbers, OpenCV's k1, k2, p1, p2, k3")
    dist = dist.ravel()
    if dist.size > _BROWN and dist.size in _OPENCV_COUNTS and not dist[_BROWN:].any():
        dist = dist[:_BROWN]
    if dist.size > _BROWN:
        raise InputError(
            f"{path}: dist has {dist.size} numbers, but motion files and Blender's lens know k1, k2, p1, p2, k3 alone; "
            "calibrate again with these five (OpenCV's calibrateCamera without flags), or undistort the video first"
        )
    return np.concatenate([dist, np.zeros(_BROWN - dist.size)])


def _size(path: Path, value: Any) -> tuple[float, float] | None:
    if value is None:
        return None
    size = _numbers(value)
    if size is None or size.shape != (2,) or not ((size >= 1) & (size <= _LARGEST_SIDE)).all():
        raise InputError(f"{path}: size must be [width, height] in pixels, but is {json.dumps(value)[:80]}")
    return float(size[0]), float(size[1])


def _can_be_undistorted(dist: np.ndarray, radius: float) -> bool:
    """Whether the picture's points up to a radius, as tangent of the angle, each come from one direction nearby.

    Those of r come to lie at r (1 + k1 r² + k2 r⁴ + k3 r⁶), which has to grow with r and to reach the radius.
    """
    k1, k2, p1, p2, k3 = dist
    if max(abs(p1), abs(p2)) > _LARGEST_TANGENTIAL:
        return False
    r = np.linspace(0.0, _LARGEST_MAGNIFICATION * radius, 1000)
    with np.errstate(all="ignore"):
        seen = r * (1 + k1 * r**2 + k2 * r**4 + k3 * r**6)
    there = np.flatnonzero(~(seen < radius))
    return (
        len(there) > 0
        and bool((np.diff(seen[: there[0] + 1]) > 0).all())
        and bool(r[there[0]] * _LARGEST_MAGNIFICATION >= radius)
    )


def _same_proportions(a: tuple[float, float], b: tuple[float, float]) -> bool:
    """Whether one size is the other one scaled, but for rounding to whole pixels of the smaller."""
    (width, height), (larger_width, larger_height) = sorted((a, b), key=math.prod)
    return (
        abs(larger_height * width / larger_width - height) <= _ONE_PIXEL
        or abs(larger_width * height / larger_height - width) <= _ONE_PIXEL
    )


def _what_to_do(known_width: float, known_height: float, width: int, height: int) -> str:
    if _same_proportions((known_height, known_width), (width, height)):
        return "the clip is rotated against them: calibrate with pictures that the camera took upright, as the clip"
    return "calibrate with pictures from the same mode of the camera, since another one crops them"
