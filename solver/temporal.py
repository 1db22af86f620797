# SPDX-License-Identifier: GPL-3.0-or-later
"""Causal temporal terms: the last frame's estimate is a constant, so it enters as priors of this frame's pose.

The root's pose becomes a row of the pose prior, each joint's state one of the joint prior with Omega_mean the last
frame's. Two-sided windows would couple frames and break the linear cost.
"""

from dataclasses import dataclass, replace

import numpy as np

from .arrays import as_array
from .measurements import Measurements, PosePriors
from .residuals import joint_prior
from .state import State
from .validation import check_rotations, check_weight


@dataclass(frozen=True)
class Temporal:
    """Weights of the last frame's estimate: rotation per radian^2 and position per metre^2 of the root; joints in
    multiples of `Weights.joint_prior`.
    """

    root_rotation: float = 100.0
    root_position: float = 100.0
    joints: float = 1.0

    def __post_init__(self) -> None:
        """Check the weights.

        :raises InvalidValueError: one is negative, infinite or no number.
        """
        for name in ("root_rotation", "root_position", "joints"):
            check_weight(getattr(self, name), f"Temporal.{name}")


def with_previous(measurements: Measurements, previous: State, temporal: Temporal) -> Measurements:
    """Return the measurements with the pull towards `previous`, in the same camera frame, added to them.

    :param previous: the last frame's state: R_camera_root (3, 3), t_camera_root (3,) in metres, Omega (K, 3, 3).
    :raises ShapeError: Omega has another shape.
    :raises InvalidValueError: Omega holds a matrix that is no rotation.
    """
    Omega = as_array(previous.Omega, (None, 3, 3), "Omega of the previous state")
    check_rotations(Omega, "Omega of the previous state")
    K = len(Omega)
    rows = joint_prior.pack(np.arange(1, K + 1), Omega, np.full(K, temporal.joints))
    tables = dict(measurements.tables)
    if "joint_prior" in tables:
        ints, floats = tables["joint_prior"]
        rows = np.concatenate([ints, rows[0]]), np.concatenate([floats, rows[1]])
    tables["joint_prior"] = rows
    own = measurements.pose_priors or PosePriors(np.zeros(0, int), np.zeros((0, 3, 3)), np.zeros((0, 3)), [], [])
    root = PosePriors(
        np.append(own.parts, 0).astype(int),
        np.concatenate([own.R_camera_part, np.asarray(previous.R_camera_root)[None]]),
        np.concatenate([own.t_camera_part, np.asarray(previous.t_camera_root)[None]]),
        np.append(own.weight_rotation, temporal.root_rotation),
        np.append(own.weight_translation, temporal.root_position),
    )
    return replace(measurements, pose_priors=root, tables=tables)
