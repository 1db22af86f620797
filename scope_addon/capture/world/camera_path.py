# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a camera was and how it was turned in every frame, in the first frame's axes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..fitting.frame_sequence import FittedTrack
from ..fitting.prepared_track import Stance


@dataclass(frozen=True)
class CameraPath:
    """p_first = R_first_camera p_camera + center for each of T frames; both are identities for a camera on a stand."""

    R_first_camera: np.ndarray  # (T, 3, 3)
    center: np.ndarray  # (T, 3) metres

    @classmethod
    def rotating(cls, R_first_camera: np.ndarray) -> CameraPath:
        """A camera that turns on the spot."""
        return cls(R_first_camera, np.zeros((len(R_first_camera), 3)))

    @classmethod
    def static(cls, frames: int) -> CameraPath:
        """A camera that stands still."""
        return cls.rotating(np.tile(np.eye(3), (frames, 1, 1)))

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.center)

    @property
    def is_static(self) -> bool:
        """Whether it does not move at all."""
        return not self.center.any() and bool((self.R_first_camera == np.eye(3)).all())

    def to_first(self, fit: FittedTrack) -> FittedTrack:
        """A fit in each frame's camera, in the first frame's axes; the fit itself where the camera does not move."""
        if self.is_static:
            return fit
        rotations = fit.rotations.copy()
        rotations[:, 0] = self.R_first_camera @ rotations[:, 0]
        root = np.einsum("tij,tj->ti", self.R_first_camera, fit.t_camera_root) + self.center
        return replace(fit, rotations=rotations, t_camera_root=root)

    def points_to_frames(self, points: np.ndarray) -> np.ndarray:
        """(T, n, 3) points of the first frame's axes in each frame's camera; the points where it does not move."""
        if self.is_static:
            return points
        return np.einsum("tji,tkj->tki", self.R_first_camera, points - self.center[:, None])

    def stance_to_frames(self, stance: Stance) -> Stance:
        """A stance in the first frame's axes, in each frame's camera; the stance itself where that does not move."""
        if self.is_static:
            return stance
        return Stance(
            self.points_to_frames(stance.root_cam[:, None])[:, 0],
            np.swapaxes(self.R_first_camera, 1, 2) @ stance.turn @ self.R_first_camera,
            np.einsum("tji,tj->ti", self.R_first_camera, stance.floor_normal),
            stance.floor_offset - (stance.floor_normal * self.center).sum(axis=1),
            stance.contact,
        )

    def world_from_frames(self, T_world_first: np.ndarray) -> np.ndarray:
        """(T, 4, 4) world_from_camera of each frame, from that of the first frame's axes (4, 4)."""
        out = np.tile(T_world_first, (len(self.center), 1, 1))
        out[:, :3, :3] = T_world_first[:3, :3] @ self.R_first_camera
        out[:, :3, 3] = self.center @ T_world_first[:3, :3].T + T_world_first[:3, 3]
        return out
