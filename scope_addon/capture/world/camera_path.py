# SPDX-License-Identifier: GPL-3.0-or-later
"""Position and rotation of the camera in every frame, in the first frame's axes; its travel, from a
person's feet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...arrays import BoolArray, Float64Array, FloatArray
from ...kinematics.smoothing import gaussian_smooth
from ...scene_gaps import steps_in_scenes
from ..fitting.frame_sequence import FittedTrack
from ..fitting.prepared_track import Stance

# Of the travel, see `camera_travel`.
MIN_SPEED_M_S = 0.25  # slower sliding is explained by depth errors
# The largest median deviation of the feet's velocities from their median, relative to it.
MAX_SPREAD = 0.8
MIN_SAMPLES = 12
MAX_VERTICAL_M_S = 0.6  # vertical speed of a sole that carries the body
MAX_HEIGHT_M = 0.03  # of such a sole above the median of the lowest soles
SMOOTH_HZ = 0.5  # a camera that is carried or driven changes its speed slowly
MEDIAN_WEIGHT = 0.02  # of the median velocity, relative to a frame's sample
FOOT_CUTOFF_HZ = 6.0
SAME_POSE = 1e-6  # metres and sines by which given poses of a static camera differ


@dataclass(frozen=True)
class CameraPath:
    """p_first = R_first_camera p_camera + center for each of T frames; identities for a static
    camera.
    """

    R_first_camera: Float64Array  # (T, 3, 3)
    center: Float64Array  # (T, 3) metres

    @classmethod
    def rotating(cls, R_first_camera: Float64Array) -> CameraPath:
        """Return the path of a camera that rotates (T, 3, 3) but does not travel."""
        return cls(R_first_camera, np.zeros((len(R_first_camera), 3)))

    @classmethod
    def static(cls, frames: int) -> CameraPath:
        """Return the path of a camera that does not move."""
        return cls.rotating(np.tile(np.eye(3), (frames, 1, 1)))

    @classmethod
    def given(cls, world_from_camera: Float64Array) -> CameraPath:
        """Return the path of a camera whose poses (T, 4, 4) in a world are known."""
        if np.ptp(world_from_camera, axis=0).max() < SAME_POSE:
            return cls.static(len(world_from_camera))
        R_first_world = world_from_camera[0, :3, :3].T
        center = world_from_camera[:, :3, 3] - world_from_camera[0, :3, 3]
        return cls(R_first_world @ world_from_camera[:, :3, :3], center @ R_first_world.T)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.center)

    @property
    def is_static(self) -> bool:
        """Whether the camera neither rotates nor travels."""
        return not self.center.any() and bool((self.R_first_camera == np.eye(3)).all())

    def to_first(self, fit: FittedTrack) -> FittedTrack:
        """Transform a fit from each frame's camera to the first frame's axes; the argument for a
        static camera.
        """
        if self.is_static:
            return fit
        root = np.einsum("tij,tj->ti", self.R_first_camera, fit.t_camera_root) + self.center
        return _turned(fit, self.R_first_camera, root)

    def to_frames(self, fit: FittedTrack) -> FittedTrack:
        """Transform a fit from the first frame's axes to each frame's camera; the argument for a
        static camera.
        """
        if self.is_static:
            return fit
        root = self.points_to_frames(fit.t_camera_root[:, None])[:, 0]
        return _turned(fit, np.swapaxes(self.R_first_camera, 1, 2), root)

    def points_to_frames(self, points: FloatArray) -> FloatArray:
        """Transform points from the first frame's axes to each frame's camera.

        :param points: (T, n, 3) metres.
        :return: (T, n, 3) metres; the argument itself for a static camera.
        """
        if self.is_static:
            return points
        return np.einsum("tji,tkj->tki", self.R_first_camera, points - self.center[:, None])

    def stance_to_frames(self, stance: Stance) -> Stance:
        """Transform a stance from the first frame's axes to each frame's camera; the argument for a
        static camera.
        """
        if self.is_static:
            return stance
        return Stance(
            self.points_to_frames(stance.root_cam[:, None])[:, 0],
            np.swapaxes(self.R_first_camera, 1, 2) @ stance.turn @ self.R_first_camera,
            np.einsum("tji,tj->ti", self.R_first_camera, stance.floor_normal),
            stance.floor_offset - (stance.floor_normal * self.center).sum(axis=1),
            stance.contact,
            stance.resting,
        )

    def world_from_frames(self, T_world_first: Float64Array) -> Float64Array:
        """Return the (T, 4, 4) world_from_camera of all frames, given that of the first frame's
        axes (4, 4).
        """
        out = np.tile(T_world_first, (len(self.center), 1, 1))
        out[:, :3, :3] = T_world_first[:3, :3] @ self.R_first_camera
        out[:, :3, 3] = self.center @ T_world_first[:3, :3].T + T_world_first[:3, 3]
        return out


def _turned(fit: FittedTrack, R: Float64Array, root: FloatArray) -> FittedTrack:
    """Return a fit in axes that are turned by R (T, 3, 3), with its root (T, 3) there."""
    rotations = fit.rotations.copy()
    rotations[:, 0] = R @ rotations[:, 0]
    return replace(fit, rotations=rotations, t_camera_root=root)


def camera_travel(
    soles: FloatArray,
    valid: BoolArray,
    up: FloatArray,
    times: Float64Array,
    uneven_ground: bool,
) -> Float64Array:
    """Return the (T, 3) displacement of the camera's centre since the first frame, metres; zeros if
    it is unknown.

    The background determines how the camera rotates (`camera_rotation`), but its travel only up to
    scale. A foot that carries the body does not move on the floor, so if all feet in contact seem
    to slide alike, the camera moves:

        v_camera(t) = −v_foot(t),
        horizontal, where a sole is the lowest of its frame and neither rises nor falls.

    This is used only for a camera that rotates: on a treadmill, feet slide in front of a static
    camera.

    :param soles: (T, F, 3) metres, relative to the camera's centre, in axes that do not rotate.
    :param valid: (T,) frames in which the person was seen.
    :param up: (3,) unit vector.
    :param times: (T,) seconds.
    :param uneven_ground: soles may carry at any height.
    """
    unknown = np.zeros((len(times), 3))
    velocity = np.gradient(gaussian_smooth(soles, times, FOOT_CUTOFF_HZ), times, axis=0)
    height = soles @ up
    lowest = height.argmin(axis=1)
    row = np.arange(len(times))
    v = velocity[row, lowest]
    h = height[row, lowest]
    carries: BoolArray = valid & (np.abs(v @ up) < MAX_VERTICAL_M_S)
    if not uneven_ground:
        carries &= h < np.median(h[valid]) + MAX_HEIGHT_M
    v = v - (v @ up)[:, None] * up
    if carries.sum() < MIN_SAMPLES:
        return unknown
    median = np.median(v[carries], axis=0)
    deviation = np.linalg.norm(v - median, axis=1)
    if np.linalg.norm(median) < MIN_SPEED_M_S or np.median(
        deviation[carries]
    ) > MAX_SPREAD * np.linalg.norm(median):
        return unknown
    carries &= deviation < 3.0 * np.median(deviation[carries])
    # A slowly changing velocity through the samples; the median far from any sample.
    weight = carries.astype(float)
    total = gaussian_smooth(weight[:, None] * v + MEDIAN_WEIGHT * median, times, SMOOTH_HZ)
    camera_velocity = total / (gaussian_smooth(weight[:, None], times, SMOOTH_HZ) + MEDIAN_WEIGHT)
    durations = steps_in_scenes(times)[1:]  # after a cut, the camera counts as not having moved
    steps = 0.5 * (camera_velocity[1:] + camera_velocity[:-1]) * durations[:, None]
    return np.concatenate([np.zeros((1, 3)), -np.cumsum(steps, axis=0)])
