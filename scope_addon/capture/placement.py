# SPDX-License-Identifier: GPL-3.0-or-later
"""A fitted track as a motion in the first frame's camera axes: gaps filled, smoothed, with its joints and soles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.body import Body
from .camera_path import CameraPath
from .fitting import FittedTrack
from .smoothing import fill_gaps, fill_rotation_gaps, smooth_root, smooth_rotations
from .soles import sole_points, with_soles
from .track import Track


@dataclass(frozen=True)
class PlacedTrack:
    """T frames without gaps, in the first frame's camera axes, metres; ``raw``: before smoothing."""

    body: Body  # with soles for these betas
    betas: np.ndarray  # (P,)
    times: np.ndarray  # (T,) seconds
    valid: np.ndarray  # (T,) bool: measured, not filled in
    rotations_raw: np.ndarray  # (T, K+1, 3, 3); part 0 R_camera_root, the others relative to their parents
    root_raw: np.ndarray  # (T, 3) the pelvis
    rotations: np.ndarray  # (T, K+1, 3, 3)
    root: np.ndarray  # (T, 3)
    joints: np.ndarray  # (T, K+1, 3)
    soles: np.ndarray  # (T, 4, 3)
    center: np.ndarray  # (T, 3) of the camera

    def place(self, rotations: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rotations and positions of all parts, and the soles, of another motion of this body, camera frame."""
        return _place(self.body, self.betas, rotations, root)


def place_track(
    body: Body, track: Track, fitted: FittedTrack, smoothing: bool, path: CameraPath | None = None
) -> PlacedTrack:
    """What a world is found from and a motion assembled from, computed once for a fit.

    :param fitted: in each frame's camera; path: where that was (None: on a stand).
    """
    path = path or CameraPath.on_a_stand(len(track))
    fitted = path.to_first(fitted)
    times, valid, betas = track.times, fitted.valid, fitted.betas
    rotations_raw = fill_rotation_gaps(fitted.rotations, valid, times)
    root_raw = fill_gaps(fitted.t_camera_root, valid, times)
    rotations, root = rotations_raw, root_raw
    if smoothing:
        rotations = smooth_rotations(rotations_raw, times)
        root = path.center + smooth_root(root_raw - path.center, times)
    soled = with_soles(body, betas)
    _, joints, soles = _place(soled, betas, rotations, root)
    return PlacedTrack(
        soled, betas, times, valid, rotations_raw, root_raw, rotations, root, joints, soles, path.center
    )


def _place(
    soled: Body, betas: np.ndarray, rotations: np.ndarray, root: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    R, t = soled.forward_kinematics(rotations, root - soled.rest_joints(betas)[0], betas)
    return R, t, sole_points(soled, R, t)
