# SPDX-License-Identifier: GPL-3.0-or-later
"""What cameras see of one frame. Each camera is linearized in its own axes, and its blocks are turned to the world's.

With R, t the world in camera axes, part i is at (R R_i, R t_i + t) there. A twist about the pelvis has the components
R w, R nu in camera axes and a joint's rotation R u, so that M = Rᵀ M' R by 3 x 3 blocks and likewise the rest. Nothing
else in the solver knows of several cameras.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import as_array
from ..compiled.part import Array, Pose
from ..compiled.tree import Tree
from ..gauss_newton.terms import PackedPriors, Terms, fill_terms, usable
from ..measurements import Measurements
from ..residuals.registry import empty_tables
from ..rotations import nearest_rotation
from ..validation import check_finite, check_rotations, check_type


@dataclass
class View:
    """What one camera measured of one frame, and where it was: a point p of the world is at R p + t in its axes.

    All measurements are in the camera's axes, and pixels with its intrinsics, as everywhere. R_camera_world (3, 3),
    t_camera_world (3,) in metres.
    """

    measurements: Measurements
    R_camera_world: ArrayLike = field(default_factory=lambda: np.eye(3))
    t_camera_world: ArrayLike = field(default_factory=lambda: np.zeros(3))


class PackedView(NamedTuple):
    """One camera's terms of one frame."""

    terms: Terms
    R: Array  # (3, 3) R_camera_world
    t: Array  # (3,)
    own_axes: bool  # whether the camera's axes are the world's


def pack_views(
    tree: Tree, frame: Measurements | Sequence[View], priors: PackedPriors, name: str
) -> tuple[list[PackedView], int]:
    """Return a frame's terms by camera, and how many measurements are usable. The first camera's have the priors.

    :param name: of the frame, for messages.
    :raises ShapeError: an array does not fit the body.
    :raises InvalidValueError: a value that no fit can use, or a frame that is neither measurements nor views.
    """
    views = [View(frame)] if isinstance(frame, Measurements) else frame
    check_type(views, Sequence, name)
    without = PackedPriors(empty_tables(), priors.shape_mean, priors.shape_information)
    packed, count = [], 0
    for k, view in enumerate(views or [View(Measurements())]):
        check_type(view, View, f"{name}[{k}]")
        R = as_array(view.R_camera_world, (3, 3), f"R_camera_world of {name}")
        t = as_array(view.t_camera_world, (3,), f"t_camera_world of {name}")
        check_rotations(R[None], f"R_camera_world of {name}")
        check_finite(t, f"t_camera_world of {name}")
        terms, _, _ = fill_terms(tree, view.measurements, without if k else priors, None)
        own_axes = bool(np.array_equal(R, np.eye(3)) and not t.any())
        packed.append(PackedView(terms, nearest_rotation(R), t, own_axes))
        count += usable(terms)
    return packed, count


def place_in_camera(view: PackedView, pose: Pose, seen: Pose) -> None:
    """Write the root of `pose` in a camera's axes, and its joints, to `seen`; the other parts are left to linearize."""
    np.matmul(view.R, pose.R[0], out=seen.R[0])
    seen.t[0] = view.R @ pose.t[0] + view.t
    seen.Omega[:] = pose.Omega
    seen.beta[:] = pose.beta
    seen.log_focal[:] = pose.log_focal
