# SPDX-License-Identifier: Apache-2.0
"""Causal temporal terms: the last frame's estimate is a constant, so it enters as priors of this
frame's pose.

The root's pose becomes a row of the pose prior, each joint's state one of the joint prior with
Omega_mean the last frame's. Two-sided windows would couple frames and break the linear cost.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .arrays import as_array, as_table
from .measurements import Measurements, PosePriors, pose_prior_arrays
from .points import has_names
from .residuals import joint_prior
from .state import State
from .validation import check_rotations, check_type, check_weight


@dataclass(frozen=True)
class Temporal:
    """Weights of the last frame's estimate: rotation per radian^2 and position per metre^2 of the
    root; joints in multiples of `Weights.joint_prior`.
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
    """Return the measurements with the pull towards `previous`, in the same camera frame, added to
    them.

    :param previous: the last frame's state: R_camera_root (3, 3), t_camera_root (3,) in metres,
        Omega (K, 3, 3).
    :raises ShapeError: an array of the state or of the measurements has another shape.
    :raises InvalidValueError: a matrix of the state is not a rotation, or an argument is of another
        type.
    """
    check_type(measurements, Measurements, "measurements")
    check_type(previous, State, "previous")
    check_type(temporal, Temporal, "temporal")
    R = as_array(previous.R_camera_root, (3, 3), "R_camera_root of the previous state")
    check_rotations(R[None], "R_camera_root of the previous state")
    t = as_array(previous.t_camera_root, (3,), "t_camera_root of the previous state")
    Omega = as_array(previous.Omega, (None, 3, 3), "Omega of the previous state")
    check_rotations(Omega, "Omega of the previous state")
    K = len(Omega)
    rows = joint_prior.pack(np.arange(1, K + 1), Omega, np.full(K, temporal.joints))
    tables = dict(measurements.tables)
    if "joint_prior" in tables:
        ints, floats = as_table(
            tables["joint_prior"], joint_prior.INTS, joint_prior.FLOATS, "joint_prior"
        )
        rows = np.concatenate([ints, rows[0]]), np.concatenate([floats, rows[1]])
    tables["joint_prior"] = rows
    own = measurements.pose_priors or PosePriors(
        np.zeros(0, int), np.zeros((0, 3, 3)), np.zeros((0, 3)), [], []
    )
    weights = np.array([temporal.root_rotation]), np.array([temporal.root_position])
    pull = (np.zeros(1, np.int64), R[None], t[None], *weights)
    named = has_names(own.parts)  # until the body tells their numbers
    parts = np.zeros(len(own.parts), np.int64) if named else own.parts  # type: ignore[arg-type]
    arrays = pose_prior_arrays(replace(own, parts=parts))
    root = PosePriors(*(np.concatenate(both) for both in zip(arrays, pull, strict=True)))
    if named:
        root = replace(root, parts=[*own.parts, 0])  # type: ignore[misc]
    return replace(measurements, pose_priors=root, tables=tables)
