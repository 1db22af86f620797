# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's camera calibration: a JSON file with OpenCV's camera matrix and distortion, for footage
of any size; or a file with a table for each camera, as other programs write them (see
`calibration_tables`).

    {"intrinsics": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], "dist": [k1, k2, p1, p2, k3],
     "size": [width, height]}

In TOML, ``calibration.toml#cam_1`` names the camera, which is only needed if there are several. A
capture of several cameras uses all of them, with their places in a common world:

    [cam_1]
    name = "cam_1"
    size = [width, height]
    matrix = [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]
    distortions = [k1, k2, p1, p2]
    rotation = [rx, ry, rz]       # rotation vector, world to camera
    translation = [tx, ty, tz]    # metres, of x_camera = R x_world + t

Keys that describe the lens are never ignored, and impossible values are refused, because a wrong
lens gives a wrong person. Other keys, such as a name or a date, are allowed.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....solver.errors import InputError
from ....solver.rotations import exp, log
from ...arrays import Float64Array
from ...atomic_write import write_result
from ...errors import UsageError
from ...footage import display_text
from ...json_file import read_json_object
from ...motion import Motion
from ...untrusted.files import in_one_line
from .calibration_tables import (
    Tables,
    camera_tables,
    has_tables,
    is_place,
    shown_names,
    split_camera,
)

_FORMAT = (
    'write {"intrinsics": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], '
    '"dist": [k1, k2, p1, p2, k3], "size": [w, h]}'
)
# The name in our files, and the names that OpenCV's examples and other programs use.
_NAMES = {
    "intrinsics": ("intrinsics", "camera_matrix", "matrix", "K"),
    "dist": ("dist", "dist_coeffs", "distortion", "distortions", "distortion_coefficients"),
    "size": ("size", "image_size"),
}
_OUR_NAMES = {name: ours for ours, names in _NAMES.items() for name in names}
# Other keys that describe the lens or the picture, by words in them or as a whole.
_LENS_KEY = re.compile(
    r".*(dist|coef|matrix|intrin|skew|fish|model|focal|resolution|size|width|height).*"
    r"|[kp]_?\d|f_?[xy]?|c_?[xy]|[wh]",
    re.I | re.S,
)
METADATA = "metadata"  # Pose2Sim's table that is none of a camera
_OPENCV_COUNTS = (0, 4, 5, 8, 12, 14)
_BROWN_COUNT = 5  # k1, k2, p1, p2, k3, as in a motion file
# Focal lengths in longer sides of the picture: fields of view of 178 and 0.6 degrees.
_FOCAL_RANGE = (0.01, 100.0)
_LARGEST_PIXEL_ASPECT = 4.0
# Of the principal point, in sides of the picture: 0.05 in real cameras. That of 16:9 is 0.13 from
# the middle of 4:3, that of 720p is 0.17 from the middle of 1080p.
_FARTHEST_FROM_MIDDLE = 0.1
# Tangent of the angle, 84 degrees, between the picture's middle and the optical axis.
_LARGEST_OFFSET = 10.0
_LARGEST_TANGENTIAL = 0.5
_LARGEST_MAGNIFICATION = 3.0  # by distortion, at half the shorter side
_LARGEST_SKEW = 1e-3  # of the focal length; less than a pixel at the picture's edge
_LARGEST_SIDE = 1e6
_SIZE_TOLERANCE_PX = 1.0  # for sizes that were rounded


@dataclass(frozen=True)
class Calibration:
    """The contents of the file. ``size`` is (width, height) of the calibration pictures; None:
    unknown.
    """

    path: Path
    intrinsics: Float64Array  # (3, 3)
    dist: Float64Array  # (5,) OpenCV's k1, k2, p1, p2, k3
    size: tuple[float, float] | None

    def intrinsics_for(self, width: int, height: int) -> Float64Array:
        """Return the intrinsics (3, 3) in pixels of footage of this size.

        :raises InputError: the footage has other proportions than the calibration pictures, or the
            values are impossible for pictures of their size.
        """
        K = self.intrinsics
        if self.size is None:
            off_middle = K[:2, 2] / [width, height] - 0.5
            if np.abs(off_middle).max() > _FARTHEST_FROM_MIDDLE:
                raise InputError(
                    f"{self.path}: the principal point ({K[0, 2]:g}, {K[1, 2]:g}) is far from the "
                    f"middle of the footage, which has {width} x {height} pixels; add "
                    '"size": [width, height] of the images it was calibrated with'
                )
        known_width, known_height = self.size or (float(width), float(height))
        if not _same_proportions((known_width, known_height), (width, height)):
            raise InputError(
                f"{self.path} is for images of {known_width:g} x {known_height:g}, the footage has "
                f"{width} x {height} pixels, which is a different aspect ratio; "
                f"{_advice(known_width, known_height, width, height)}"
            )
        longer = max(known_width, known_height)
        if not all(_FOCAL_RANGE[0] * longer <= K[i, i] <= _FOCAL_RANGE[1] * longer for i in (0, 1)):
            raise InputError(
                f"{self.path}: no lens has focal lengths of {K[0, 0]:g} and {K[1, 1]:g} pixels in "
                f"images of {known_width:g} x {known_height:g}; give them in pixels, with the size "
                "of the calibration images"
            )
        if not 1 / _LARGEST_PIXEL_ASPECT <= K[0, 0] / K[1, 1] <= _LARGEST_PIXEL_ASPECT:
            raise InputError(
                f"{self.path}: focal lengths of {K[0, 0]:g} and {K[1, 1]:g} pixels differ too "
                "much; calibrate again"
            )
        off_axis = (np.array([known_width, known_height]) / 2 - K[:2, 2]) / K[[0, 1], [0, 1]]
        if np.abs(off_axis).max() > _LARGEST_OFFSET:
            raise InputError(
                f"{self.path}: the principal point ({K[0, 2]:g}, {K[1, 2]:g}) is too far from "
                "images of "
                f"{known_width:g} x {known_height:g}; give it in pixels from their top left corner"
            )
        if not _can_be_undistorted(self.dist, min(known_width, known_height) / (K[0, 0] + K[1, 1])):
            raise InputError(
                f"{self.path}: dist {self.dist.tolist()} folds or tears the image; give OpenCV's "
                "k1, k2, p1, p2, k3, in this order, from the same calibration as the intrinsics"
            )
        return np.diag([width / known_width, height / known_height, 1.0]) @ K


def read_calibration(path: Path) -> Calibration:
    """Read a calibration from a file.

    :param path: of one with tables, the camera's name may follow after a #.
    :raises InputError: the file cannot be read, or holds an unknown key or an impossible value; or
        it has several cameras, and none or another one is named.
    """
    file, camera = split_camera(path)
    if has_tables(file):
        content = _lens_of(file, camera)
    else:
        content = read_json_object(path, InputError, "calibration", _FORMAT)
    return calibration_of(path, content)


def calibration_of(path: Path, content: dict[str, Any]) -> Calibration:
    """Return the calibration that a file's content describes.

    :raises InputError: it holds an unknown key or an impossible value.
    """
    values = _by_our_names(path, content)
    if "intrinsics" not in values:
        raise InputError(f'{path} is not a calibration: it has no "intrinsics"; {_FORMAT}')
    intrinsics = _intrinsics(path, values["intrinsics"])
    return Calibration(
        path, intrinsics, _distortion(path, values.get("dist")), _size(path, values.get("size"))
    )


def placed_cameras(path: Path, stems: Sequence[str]) -> list[tuple[Path, Float64Array | None]]:
    """Return, for each video of a take, its calibration and its camera's (4, 4) world to camera,
    metres; None where the file does not say it.

    The cameras of a file with tables belong to the videos of the same names, whatever their case
    and signs between words are, and otherwise to the videos in their order. Any other calibration
    is that of all cameras, whose places are unknown.

    :param stems: names of the videos without suffix.
    :raises InputError: the file cannot be read, or its cameras are not those of the videos.
    """
    file, camera = split_camera(path)
    if not has_tables(file) or camera:
        return [(path, None)] * len(stems)
    cameras = _cameras(file)
    if len(cameras) == 1:
        return [(path, None)] * len(stems)
    by_name: dict[str, str] = {}
    for key, table in cameras.items():
        for name in (str(table.get("name", key)), key):
            by_name.setdefault(_letters(name), key)
    keys = [by_name.get(_letters(stem), "") for stem in stems]
    if "" in keys or len(set(keys)) < len(keys):
        if len(cameras) != len(stems):
            raise InputError(
                f"{file} has the cameras {shown_names(cameras)}, which are not the names of the "
                f"{len(stems)} videos: name them in the file after the videos, such as {stems[0]}"
            )
        keys = list(cameras)
    return [(Path(f"{file}#{key}"), _world_to_camera(file, key, cameras[key])) for key in keys]


def _letters(name: str) -> str:
    """Return the letters and digits of a name, in lower case."""
    return re.sub(r"[\W_]", "", name).lower()


def _world_to_camera(path: Path, name: str, table: dict[str, Any]) -> Float64Array | None:
    """Return the place (4, 4) of one of a file's cameras; None where it does not say it."""
    if table.get("rotation") is None or table.get("translation") is None:
        return None
    rotation = _numbers(table["rotation"])
    translation = _numbers(table["translation"])
    if rotation is None or translation is None or rotation.size != 3 or translation.size != 3:
        raise InputError(
            f"{path}: rotation and translation of {in_one_line(name)} must be three numbers each: "
            "a rotation vector, world to camera, and metres"
        )
    if not is_place(rotation.ravel(), translation.ravel()):
        raise InputError(
            f"{path}: the rotation of {in_one_line(name)} turns by more than two turns, or its "
            "translation is no place; give a rotation vector in radians, and metres"
        )
    T = np.eye(4)
    T[:3, :3] = exp(rotation.ravel())
    T[:3, 3] = translation.ravel()
    return T


def write_calibration(path: Path, motion: Motion) -> None:
    """Write the cameras of a motion; see `calibration_text`.

    :raises UsageError: the footage is mirrored, as which no camera has seen it.
    :raises OutputError: the file cannot be written.
    """
    if motion.view.is_mirrored:
        raise UsageError(
            "the footage was mirrored, so its cameras have no places; capture without --mirror"
        )
    write_result(path, calibration_text(motion))


def calibration_text(motion: Motion) -> str:
    """Return the cameras of a motion as a TOML file of Pose2Sim, with the motion's world, whose z
    points up.

    :param motion: of a camera that stands still, and of footage that is not mirrored.
    """
    seen = [motion, *(motion.from_view(number) for number in range(motion.view_count))]
    view = motion.view
    lines: list[str] = []
    names = [METADATA]
    for number, each in enumerate(seen, 1):
        size = each.image_size.tolist()
        turned = np.linalg.inv(each.world_from_camera[0])
        turned[:3] = view.axes.T @ turned[:3]
        name = display_text(Path(each.source).stem)
        while name in names:
            name = f"{name}_{number}"
        names.append(name)
        dist = view.inverse.distortion(each.dist)
        values = {
            "name": name,
            "size": [float(side) for side in view.size(*size)],
            "matrix": view.inverse.intrinsics(each.intrinsics, *size).tolist(),
            "distortions": dist.tolist(),
            "rotation": log(turned[:3, :3]).tolist(),
            "translation": turned[:3, 3].tolist(),
            "fisheye": False,
        }
        # Lists of numbers, strings and booleans are the same in JSON and TOML, but not escapes of
        # what 16 bits do not hold.
        lines.append(f"[{json.dumps(name, ensure_ascii=False)}]")
        lines += [
            f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in values.items()
        ]
        lines.append("")
    lines += [
        f"[{METADATA}]",
        "adjusted = false",
        f"error = {motion.mean_residual_px}",
        "",
    ]
    return "\n".join(lines)


def _cameras(path: Path) -> Tables:
    """Return the tables of a file's cameras, by name.

    :raises InputError: the file cannot be read.
    """
    return camera_tables(path, _NAMES["intrinsics"])


def _lens_of(path: Path, camera: str) -> dict[str, Any]:
    """Return the lens of one of a file's cameras; what concerns its place is left out.

    :raises InputError: the file cannot be read, or does not say which camera it is.
    """
    cameras = _cameras(path)
    names = shown_names(cameras)
    if camera and camera not in cameras:
        raise InputError(f"{path} has no camera {camera!r}; its cameras are {names}")
    if not camera and len(cameras) != 1:
        raise InputError(
            f"{path} has the cameras {names}: name the one that filmed the clip, as in "
            f"{path.name}#{in_one_line(next(iter(cameras), 'camera'))}"
        )
    table = cameras[camera or next(iter(cameras))]
    if table.get("fisheye"):
        raise InputError(f"{path}: fisheye lenses are not supported; undistort the video first")
    return {key: value for key, value in table.items() if key in _OUR_NAMES}


def _by_our_names(path: Path, data: dict[str, Any]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name, value in data.items():
        ours = _OUR_NAMES.get(name)
        if ours is None:
            if _LENS_KEY.fullmatch(name):
                known = ", ".join(_OUR_NAMES)
                raise InputError(
                    f"{path}: {name[:80]!r} is unknown; use one of {known}, or remove it"
                )
            continue
        if ours in values:
            twice = " and ".join(n for n in data if n in _NAMES[ours])
            raise InputError(f"{path} gives the same value twice, as {twice}; remove one of them")
        values[ours] = value
    return values


def array_of(value: Any) -> Float64Array | None:
    """Return an array of numbers of any shape, finite or not; None if the value is something
    else.
    """
    try:
        return np.array(value, float)
    except (ValueError, TypeError):
        return None


def _numbers(value: Any) -> Float64Array | None:
    """Return an array of finite numbers of any shape, or None if the value is something else."""
    array = array_of(value)
    return array if array is not None and np.isfinite(array).all() else None


def _intrinsics(path: Path, value: Any) -> Float64Array:
    K = _numbers(value)
    if K is None or K.shape != (3, 3):
        raise InputError(f"{path}: intrinsics must be three rows of three numbers; {_FORMAT}")
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        raise InputError(
            f"{path}: intrinsics have focal lengths {K[0, 0]:g} and {K[1, 1]:g}, "
            "which must be above 0"
        )
    if K[1, 0] != 0 or not np.array_equal(K[2], [0, 0, 1]):
        raise InputError(
            f"{path}: intrinsics must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], but "
            f"are {K.tolist()}"
        )
    if abs(K[0, 1]) > _LARGEST_SKEW * K[0, 0]:
        raise InputError(
            f"{path}: intrinsics have a skew of {K[0, 1]:g}; calibrate without one, as OpenCV does"
        )
    K[0, 1] = 0.0
    return K


def _distortion(path: Path, value: Any) -> Float64Array:
    if value is None:
        return np.zeros(_BROWN_COUNT)
    dist = _numbers(value)
    # A row or a column, as OpenCV writes it.
    if dist is None or max(dist.shape, default=0) != dist.size:
        raise InputError(f"{path}: dist must be a list of numbers, OpenCV's k1, k2, p1, p2, k3")
    dist = dist.ravel()
    if dist.size > _BROWN_COUNT and dist.size in _OPENCV_COUNTS and not dist[_BROWN_COUNT:].any():
        dist = dist[:_BROWN_COUNT]
    if dist.size > _BROWN_COUNT:
        raise InputError(
            f"{path}: dist has {dist.size} numbers, but motion files and Blender's lens support "
            "only k1, k2, p1, p2, k3; calibrate again with these five (OpenCV's calibrateCamera "
            "without flags), or undistort the video first"
        )
    return np.concatenate([dist, np.zeros(_BROWN_COUNT - dist.size)])


def _size(path: Path, value: Any) -> tuple[float, float] | None:
    if value is None:
        return None
    size = _numbers(value)
    if size is None or size.shape != (2,) or not ((size >= 1) & (size <= _LARGEST_SIDE)).all():
        raise InputError(
            f"{path}: size must be [width, height] in pixels, but is {json.dumps(value)[:80]}"
        )
    return float(size[0]), float(size[1])


def _can_be_undistorted(dist: Float64Array, radius: float) -> bool:
    """Return whether each point of the picture up to a radius corresponds to one direction nearby.

    A point at r is imaged at r (1 + k1 r² + k2 r⁴ + k3 r⁶), which has to grow with r and to reach
    the radius.

    :param dist: (5,)
    :param radius: tangent of the angle to the optical axis.
    """
    k1, k2, p1, p2, k3 = dist
    if max(abs(p1), abs(p2)) > _LARGEST_TANGENTIAL:
        return False
    r = np.linspace(0.0, _LARGEST_MAGNIFICATION * radius, 1000)
    with np.errstate(all="ignore"):
        imaged = r * (1 + k1 * r**2 + k2 * r**4 + k3 * r**6)
    reached = np.flatnonzero(~(imaged < radius))
    return (
        len(reached) > 0
        and bool((np.diff(imaged[: reached[0] + 1]) > 0).all())
        and bool(r[reached[0]] * _LARGEST_MAGNIFICATION >= radius)
    )


def _same_proportions(a: tuple[float, float], b: tuple[float, float]) -> bool:
    """Return whether one size is the other one scaled, up to rounding to whole pixels of the
    smaller one.
    """
    (width, height), (larger_width, larger_height) = sorted((a, b), key=math.prod)
    return (
        abs(larger_height * width / larger_width - height) <= _SIZE_TOLERANCE_PX
        or abs(larger_width * height / larger_height - width) <= _SIZE_TOLERANCE_PX
    )


def _advice(known_width: float, known_height: float, width: int, height: int) -> str:
    if _same_proportions((known_height, known_width), (width, height)):
        return (
            "the clip is rotated relative to them: calibrate with images in the orientation of the "
            "clip"
        )
    return "calibrate with images from the same camera mode, because another one crops them"
