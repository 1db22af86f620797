# SPDX-License-Identifier: GPL-3.0-or-later
"""Position and rotation of the camera in every frame, in the first frame's axes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..fitting.frame_sequence import FittedTrack
from ..fitting.prepared_track import Stance


@dataclass(frozen=True)
class CameraPath:
    """p_first = R_first_camera p_camera + center for each of T frames; identities for a static camera."""

    R_first_camera: NDArray[np.float64]  # (T, 3, 3)
    center: NDArray[np.float64]  # (T, 3) metres

    @classmethod
    def rotating(cls, R_first_camera: NDArray[np.float64]) -> CameraPath:
        """Return the path of a camera that rotates (T, 3, 3) but does not travel."""
        return cls(R_first_camera, np.zeros((len(R_first_camera), 3)))

    @classmethod
    def static(cls, frames: int) -> CameraPath:
        """Return the path of a camera that does not move."""
        return cls.rotating(np.tile(np.eye(3), (frames, 1, 1)))

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.center)

    @property
    def is_static(self) -> bool:
        """Whether the camera neither rotates nor travels."""
        return not self.center.any() and bool((self.R_first_camera == np.eye(3)).all())

    def to_first(self, fit: FittedTrack) -> FittedTrack:
        """Transform a fit from each frame's camera to the first frame's axes; the argument for a static camera."""
        if self.is_static:
            return fit
        rotations = fit.rotations.copy()
        rotations[:, 0] = self.R_first_camera @ rotations[:, 0]
        root = np.einsum("tij,tj->ti", self.R_first_camera, fit.t_camera_root) + self.center
        return replace(fit, rotations=rotations, t_camera_root=root)

    def to_frames(self, fit: FittedTrack) -> FittedTrack:
        """Transform a fit from the first frame's axes to each frame's camera; the argument for a static camera."""
        if self.is_static:
            return fit
        rotations = fit.rotations.copy()
        rotations[:, 0] = np.swapaxes(self.R_first_camera, 1, 2) @ rotations[:, 0]
        root = self.points_to_frames(fit.t_camera_root[:, None])[:, 0]
        return replace(fit, rotations=rotations, t_camera_root=root)

    def points_to_frames(self, points: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
        """Transform points from the first frame's axes to each frame's camera.

        :param points: (T, n, 3) metres.
        :return: (T, n, 3) metres; the argument itself for a static camera.
        """
        if self.is_static:
            return points
        local: NDArray[np.float64] = np.einsum("tji,tkj->tki", self.R_first_camera, points - self.center[:, None])
        return local

    def stance_to_frames(self, stance: Stance) -> Stance:
        """Transform a stance from the first frame's axes to each frame's camera; the argument for a static camera."""
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

    def world_from_frames(self, T_world_first: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (T, 4, 4) world_from_camera of all frames, given that of the first frame's axes (4, 4)."""
        out = np.tile(T_world_first, (len(self.center), 1, 1))
        out[:, :3, :3] = T_world_first[:3, :3] @ self.R_first_camera
        out[:, :3, 3] = self.center @ T_world_first[:3, :3].T + T_world_first[:3, 3]
        return out
