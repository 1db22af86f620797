# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera that another program has solved, such as Blender's tracker: a JSON file with its lens,
as in a calibration, and where it is at some times of the footage.

    {"intrinsics": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], "size": [width, height],
     "times_s": [0.0, 0.04, ...],
     "world_from_camera": [[[r, r, r, x], [r, r, r, y], [r, r, r, z], [0, 0, 0, 1]], ...]}

The world is in metres, with z up; the camera's axes are OpenCV's: x right, y down, z forward. Times
are those of the frames in the file, of which the first one is at 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....solver.errors import InputError
from ....solver.rotations import nearest_rotation
from ...arrays import Float64Array
from ...json_file import read_json_object
from ...kinematics.smoothing import interpolated_places, interpolated_rotations
from .calibration import Calibration, array_of, calibration_of

_FORMAT = (
    'write {"intrinsics": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], "size": [w, h], '
    '"times_s": [...], "world_from_camera": [4 x 4 matrices]}'
)
_LARGEST_BYTES = 64_000_000  # three hours with 30 poses per second
LONGEST_GAP_S = 0.5  # between two poses between which the camera is interpolated
MAX_SCALE = 1e-3  # of a rotation's axes, which are of length 1, and of their products


@dataclass(frozen=True)
class GivenPath:
    """The contents of the file."""

    calibration: Calibration
    times_s: Float64Array  # (N,) ascending
    world_from_camera: Float64Array  # (N, 4, 4) metres, z up

    def at(self, times_s: Float64Array) -> Float64Array:
        """Return the (T, 4, 4) poses at times of the footage (T,), interpolated on arcs and lines.

        A single pose is that of a camera that does not move.

        :raises InputError: there is no pose near one of the times.
        """
        known = self.times_s
        if len(known) == 1:
            return np.tile(self.world_from_camera, (len(times_s), 1, 1))
        steps = np.diff(known)
        margin = 0.5 * float(np.median(steps)) + 1e-3
        if times_s.min() < known[0] - margin or times_s.max() > known[-1] + margin:
            raise InputError(
                f"{self.calibration.path} has poses from {known[0]:.2f} to {known[-1]:.2f} s, but "
                f"frames are captured from {times_s.min():.2f} to {times_s.max():.2f} s; give "
                "poses of all frames, or capture the part that has them"
            )
        after = np.clip(np.searchsorted(known, times_s, side="right"), 1, len(steps))
        around = known[np.stack([after - 1, after], axis=1)]
        nearest_s = np.abs(times_s[:, None] - around).min(axis=1)
        in_gap = (steps[after - 1] > LONGEST_GAP_S) & (nearest_s > margin)
        if in_gap.any():
            gap = int(after[in_gap.argmax()])
            raise InputError(
                f"{self.calibration.path} has no pose from {known[gap - 1]:.2f} to "
                f"{known[gap]:.2f} s; give poses of all frames, or capture the part that has them"
            )
        inside = np.clip(times_s, known[0], known[-1])
        poses = np.tile(np.eye(4), (len(times_s), 1, 1))
        poses[:, :3, :3] = interpolated_rotations(self.world_from_camera[:, :3, :3], known, inside)
        poses[:, :3, 3] = interpolated_places(self.world_from_camera[:, :3, 3], known, inside)
        return poses


def read_camera_path(path: Path) -> GivenPath:
    """Read the lens and the path of a camera.

    :raises InputError: the file cannot be read, or holds something else.
    """
    content = read_json_object(path, InputError, "camera path", _FORMAT, _LARGEST_BYTES)
    poses = _poses(path, content.pop("world_from_camera", None))
    times_s = _times(path, content.pop("times_s", None), len(poses))
    return GivenPath(calibration_of(path, content), times_s, poses)


def _times(path: Path, value: Any, count: int) -> Float64Array:
    times = array_of(value)
    if times is None or times.shape != (count,):
        raise InputError(
            f'{path}: "times_s" must be a list of {count} numbers, one for each pose, in seconds; '
            f"{_FORMAT}"
        )
    if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
        raise InputError(f'{path}: "times_s" must be finite numbers that ascend')
    return times


def _poses(path: Path, value: Any) -> Float64Array:
    """Return the poses (N, 4, 4), N at least 1."""
    poses = array_of(value)
    if poses is None or poses.ndim != 3 or poses.shape[1:] != (4, 4) or not len(poses):
        raise InputError(
            f'{path}: "world_from_camera" must be a list of matrices with four rows of four '
            f"numbers; {_FORMAT}"
        )
    _refuse(path, ~np.isfinite(poses).all(axis=(1, 2)), "has a value that is not a finite number")
    _refuse(path, (poses[:, 3] != [0, 0, 0, 1]).any(axis=1), "must have the last row 0, 0, 0, 1")
    R = poses[:, :3, :3]
    lengths = np.linalg.norm(R, axis=1)
    is_scaled = np.abs(lengths - 1.0).max(axis=1) > MAX_SCALE
    _refuse(path, is_scaled, "is scaled; give rotations without scale, and positions in metres")
    products = np.swapaxes(R, 1, 2) @ R - np.eye(3)
    is_skewed = np.abs(products).max(axis=(1, 2)) > 3.0 * MAX_SCALE
    _refuse(path, is_skewed | (np.linalg.det(R) < 0), "is sheared or mirrored, not a rotation")
    poses[:, :3, :3] = nearest_rotation(R)
    return poses


def _refuse(path: Path, is_wrong: Any, what: str) -> None:
    """Raise an error that names the first pose of which something is true (N,)."""
    if is_wrong.any():
        number = int(is_wrong.argmax())
        raise InputError(f'{path}: pose {number} of "world_from_camera" {what}')
