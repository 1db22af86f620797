# SPDX-License-Identifier: Apache-2.0
"""What every residual r(T_i, Omega_i, beta) is a function of, its derivatives, and the sums they go
into.

Derivatives are with respect to
    x     (6,) twist (w, nu) of the part in camera axes about `origin`: R <- exp(w) R,
          t <- t + w x (t - origin) + nu.
          `origin` is the pelvis t_0, so that they do not grow with the distance from the camera
    u     (3,) rotation of the joint in camera axes, Omega <- R_par^T exp(u) R_par Omega, with
          T_i held fixed
    beta  (P,) total derivative, including the motion D dbeta of the part's origin
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]  # float64, or int64 for indices


@dataclass
class Part:
    """Pose of one body part and the state of its joint; lengths in metres, camera frame."""

    R: Array  # (3, 3) R_camera_part
    t: Array  # (3,)
    D: Array  # (3, P) dt/dbeta
    Omega: Array  # (3, 3) joint state
    R_parent: Array  # (3, 3) R_camera_parent
    origin: Array  # (3,) the point that twists refer to
    beta: Array  # (P,)


class Linearization(NamedTuple):
    """A residual vector of length n and its derivatives."""

    r: Array  # (n,)
    J_x: Array  # (n, 6)
    J_u: Array  # (n, 3)
    J_beta: Array  # (n, P)


class Pose(NamedTuple):
    """The unknowns and what follows from them, for the kernels. W as in `Tree`."""

    Omega: Array  # (K+1, 3, 3), row 0 unused
    R: Array  # (K+1, 3, 3) R_camera_part
    t: Array  # (K+1, 3)
    D: Array  # (K+1, 3, W)
    beta: Array  # (W,)
    log_focal: Array  # (1,), logarithm of the focal length over that of the given intrinsics


class Blocks(NamedTuple):
    """Gauss-Newton blocks of 1/2 sum |r|^2: JᵀJ and Jᵀr by part, and one C, c for all parts.

    The columns of A and H_u are [6 for x | gradient | 0 | W for beta]; of C only the upper triangle
    is kept.
    """

    A: Array  # (K+1, 6, 8+W): [M | m | 0 | N]
    H_u: Array  # (K+1, 3, 8+W): [H_ux | g_u | 0 | H_ubeta]
    H_uu: Array  # (K+1, 3, 3)
    C: Array  # (W, W)
    c: Array  # (W,)
    cross: NDArray[np.int64]  # (1,): 1 when some residual has added to H_ux or H_ubeta


GRADIENT = 6  # column of m and g_u
SHAPE = 8  # first column of N and H_ubeta
