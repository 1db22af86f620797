# SPDX-License-Identifier: Apache-2.0
"""The unknowns of one frame, and what a fit gives back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Literal

import numpy as np

from .arrays import as_array
from .errors import InvalidValueError, ShapeError
from .gauss_newton.linearize import make_pose, place_parts
from .part import Array, Pose
from .rotations import nearest_rotation
from .tree import Tree
from .validation import as_number, check_count, check_list, check_rotations, check_type


class Status(Enum):
    """Why the optimizer stopped."""

    CONVERGED = 0  # the last stage's relative decrease fell below its tolerance
    MAX_ITERATIONS = 1  # the last stage ran out of iterations
    # no damping, however large, found a lower cost: a minimum to rounding, or a contradiction
    STALLED = 2
    # nothing that `Fit.measurements` counts was usable: the state is the initial one
    NO_MEASUREMENTS = 3
    NON_FINITE = 4  # the cost of the initial state is not finite: the state is the initial one


@dataclass
class State:
    """Pose and shape of one frame, camera frame, metres."""

    R_camera_root: Array  # (3, 3)
    t_camera_root: Array  # (3,), the pelvis
    Omega: Array  # (K, 3, 3), states of joints 1..K relative to their parents
    beta: Array  # (P,)

    @classmethod
    def rest(cls, K: int, P: int, distance: float = 3.0) -> State:
        """Return the rest pose of K joints, beta (P,) zero, upright and facing a camera `distance`
        metres away.

        :raises InvalidValueError: K or P is not a whole number of at least 0, or the distance is
            not positive.
        """
        check_count(K, "K", 0)
        check_count(P, "P", 0)
        if not 0.0 < as_number(distance, "distance") < math.inf:
            raise InvalidValueError(f"distance must be positive and finite, but is {distance}.")
        R_camera_root = np.diag([1.0, -1.0, -1.0])
        return cls(
            R_camera_root,
            np.array([0.0, 0.0, distance]),
            np.tile(np.eye(3), (K, 1, 1)),
            np.zeros(P),
        )

    def pose(self, tree: Tree) -> Pose:
        """Return the state for the kernels, with rotations made orthonormal.

        :raises ShapeError: an array does not fit the tree.
        :raises InvalidValueError: R_camera_root, or a matrix of Omega, is not a rotation.
        """
        check_type(tree, Tree, "tree")
        pose = make_pose(tree)
        self.write_to(tree, pose)
        place_parts(tree, pose)
        return pose

    def write_to(self, tree: Tree, pose: Pose) -> None:
        """Write the unknowns to a pose of the kernels; its other parts are left to `place_parts`.

        :raises ShapeError: an array does not fit the tree.
        :raises InvalidValueError: R_camera_root, or a matrix of Omega, is not a rotation.
        """
        R, t, Omega, beta = self.arrays(tree)
        pose.R[0] = nearest_rotation(R)
        pose.t[0] = t
        pose.Omega[1:] = nearest_rotation(Omega)
        pose.beta[: tree.shape_count] = beta
        pose.log_focal[0] = 0.0

    def arrays(self, tree: Tree) -> tuple[Array, Array, Array, Array]:
        """Return R_camera_root (3, 3), t_camera_root (3,), Omega (K, 3, 3) and beta (P,), checked.

        :raises ShapeError: an array does not fit the tree.
        :raises InvalidValueError: R_camera_root, or a matrix of Omega, is not a rotation.
        """
        R = as_array(self.R_camera_root, (3, 3), "R_camera_root")
        t = as_array(self.t_camera_root, (3,), "t_camera_root")
        Omega = as_array(self.Omega, (len(tree.parents) - 1, 3, 3), "Omega")
        check_rotations(R[None], "R_camera_root of the initial state")
        check_rotations(Omega, "Omega of the initial state")
        return R, t, Omega, as_array(self.beta, (tree.shape_count,), "beta")

    @classmethod
    def from_pose(cls, tree: Tree, pose: Pose) -> State:
        """Copy the state out of the kernels' arrays."""
        return cls(
            pose.R[0].copy(),
            pose.t[0].copy(),
            pose.Omega[1:].copy(),
            pose.beta[: tree.shape_count].copy(),
        )


# In place of an initial state: begin with several headings, and keep the fit of the lowest cost.
MULTI: Literal["multi"] = "multi"


def given_states(
    init: Sequence[State | None] | Literal["multi"] | None,
    frames: int,
    kinds: type | tuple[type, ...] = State,
) -> tuple[Sequence[Any] | None, Literal["multi"] | None]:
    """Return the initial states of frames, checked, or None; and without them, `init` of `fit` for
    each frame.

    :param kinds: what an entry may be.
    :raises InvalidValueError: they are not a list, or an entry is of another type.
    :raises ShapeError: there are more or fewer than `frames`.
    """
    if init is None:
        return None, None
    if isinstance(init, str) and init == MULTI:
        return None, MULTI
    check_list(init, "init", "frame")
    if len(init) != frames:
        raise ShapeError(
            f"There must be one initial state per frame, {frames}, but got {len(init)}."
        )
    for k, state in enumerate(init):
        check_type(state, kinds, f"init[{k}]")
    return init, None


@dataclass
class Fit:
    """Result of one frame, and how it was reached.

    state; R_camera_part (K+1, 3, 3) and t_camera_part (K+1, 3), the joints, metres, are its parts.
    status: why the optimizer stopped. cost: of the last stage's weights; cost_by_term adds up to
    it, with Options.report only. iterations: evaluations of the blocks after the first; rejected:
    of them, those whose step did not lower the cost. beta_information (P, P): of this frame's
    measurements alone, pose eliminated; shape prior not included. measurements: usable points,
    directions, rows of pose priors, contacts, points above a floor,
    and rows of further tables; seen: of them, the points, directions and rows of pose priors.
    """

    state: State = field(repr=False)
    status: Status
    cost: float
    iterations: int
    R_camera_part: Array = field(repr=False)
    t_camera_part: Array = field(repr=False)
    beta_information: Array = field(repr=False)
    measurements: int
    seen: int = 0
    rejected: int = field(default=0, repr=False)
    cost_by_term: dict[str, float] = field(default_factory=dict)


@dataclass
class ClipFit:
    """Result of a clip with one shape.

    frames: each with a status and a cost of its own. beta (P,); beta_information (P, P): summed
    over the frames, shape prior included. focal_scale: estimated focal length over that of the
    intrinsics; 1 if it was not estimated. status, cost, cost_by_term, iterations, rejected: as of
    `Fit`, of the fit of all frames that found the shape.
    """

    frames: list[Fit] = field(repr=False)
    beta: Array = field(repr=False)
    beta_information: Array = field(repr=False)
    focal_scale: float
    status: Status
    cost: float
    iterations: int
    rejected: int = field(default=0, repr=False)
    cost_by_term: dict[str, float] = field(default_factory=dict)
