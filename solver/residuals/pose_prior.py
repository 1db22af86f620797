# SPDX-License-Identifier: Apache-2.0
"""A known estimate (R^, t^) of a part's pose in the camera frame, such as last frame's.

    r = (sqrt(w_R) log(R^ᵀ R), sqrt(w_t) (t - t^)),   radians and metres
    dr_R/dx = sqrt(w_R) J^-1(phi) R^ᵀ [I, 0],  phi = log(R^ᵀ R)
    dr_t/dx = sqrt(w_t) [-[t - origin]x, I],   dr_t/dbeta = sqrt(w_t) D
Comparing positions rather than log(T T^-1) keeps the residual independent of the distance from the
camera. Source: section 3 of the paper (pose prior on T_i).
"""

import numpy as np

from ..kernel import kernel
from ..matrices import product, rotated, symmetric, transposed, turned
from ..part import GRADIENT, Array
from ..rotations import left_jacobian_inverse3
from .accumulation import add_to_point, relative_log, rows_of

INTS = 1  # part
FLOATS = 14  # R^ (9) by rows, t^ (3), w_R, w_t
INDEXES = "parts"
WEIGHTS = slice(12, 14)


@kernel
def accumulate(tree, ints, floats, weight, pose, blocks):  # type: ignore[no-untyped-def]
    """Add every row's M, N, m, C, c to the blocks and return the cost. ints (n, 1), floats (n,
    14).
    """
    A = blocks.A
    cost = 0.0
    for k in range(ints.shape[0]):
        i = ints[k, 0]
        h = floats[k]
        R = pose.R[i]
        w_r = weight * h[12]
        w_t = weight * h[13]
        if w_r > 0.0:
            phi = relative_log(h, R)
            cost += 0.5 * w_r * (phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
            Jt = product(h, transposed(left_jacobian_inverse3(*phi)))
            H = symmetric(turned(Jt, (w_r, 0.0, 0.0, w_r, 0.0, w_r)))
            g = rotated(Jt, phi)
            for r in range(3):
                A[i, r, GRADIENT] += w_r * g[r]
                for s in range(3):
                    A[i, r, s] += H[3 * r + s]
        if w_t > 0.0:
            f0 = pose.t[i, 0] - h[9]
            f1 = pose.t[i, 1] - h[10]
            f2 = pose.t[i, 2] - h[11]
            cost += 0.5 * w_t * (f0 * f0 + f1 * f1 + f2 * f2)
            origin = tree.keypoints + i  # the part's origin as a point
            add_to_point(
                tree, pose, blocks, origin, 0.0, 0.0, 0.0,
                w_t, 0.0, 0.0, w_t, 0.0, w_t, w_t * f0, w_t * f1, w_t * f2,
            )  # fmt: skip
    return cost


def pack(
    parts: Array, R_camera_part: Array, t_camera_part: Array, w_R: Array, w_t: Array
) -> tuple[Array, Array]:
    """Return the tables of `accumulate`: int64 (n, 1) and float64 (n, 14).

    :param parts: (n,) in 0..K.
    :param R_camera_part, t_camera_part: (n, 3, 3), (n, 3) the expected poses, metres, camera frame.
    :param w_R, w_t: (n,), (n,) weights per radian^2 and per metre^2.
    """
    return rows_of(parts, np.reshape(R_camera_part, (len(parts), 9)), t_camera_part, w_R, w_t)
