# SPDX-License-Identifier: GPL-3.0-or-later
"""The raw motion of a person, of which every frame is fitted alone, as it is kept until the world is known.

An hour of rotation matrices takes 93 MB, as rotation vectors a third of that. The world turns the root alone, so the
other joints have the rotation vectors of the motion file from the start.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import rotations
from ...kinematics.frame_blocks import by_blocks
from ..fitting.frame_sequence import FittedTrack
from ..tracking.track import Track
from .camera_path import CameraPath
from .placement import without_gaps


@dataclass(frozen=True)
class RawMotion:
    """T frames without gaps, in the first frame's camera axes, metres and radians, and what is known of the fit."""

    R_first_root: NDArray[np.floating[Any]]  # (T, 3, 3)
    t_first_root: NDArray[np.floating[Any]]  # (T, 3) the pelvis
    joints: NDArray[np.float32]  # (T, K, 3) rotation vectors relative to the parent
    joint_confidence: NDArray[np.floating[Any]]  # (T, K+1) 0..1
    joint_sigma_m: NDArray[np.floating[Any]] | None  # (T, K+1, 2), as in `FittedTrack`
    height_sigma_m: float

    @classmethod
    def of(cls, track: Track, fitted: FittedTrack, path: CameraPath) -> RawMotion:
        """Return the motion of a fit in each frame's camera."""
        matrices, t_first_root = without_gaps(track, fitted, path)
        return cls(
            matrices[:, 0].copy(), t_first_root, rotation_vectors_of_joints(matrices), fitted.joint_confidence,
            fitted.joint_sigma_m, fitted.height_sigma_m,
        )  # fmt: skip


def rotation_vectors_of_joints(matrices: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
    """Return (T, K, 3) for rotations (T, K+1, 3, 3) without the root's, in single precision as in the motion file."""
    (vectors,) = by_blocks(lambda some: (rotations.log(some[:, 1:]).astype(np.float32),), matrices)
    return vectors
