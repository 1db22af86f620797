# SPDX-License-Identifier: Apache-2.0
"""The floor: no point may be below it, and one in contact may not be above it either.

    h = n^T p - d,   p = R_i (V_j beta + v_bar_j) + t_i,
    metres above the plane n^T p = d in the camera frame
    r = sqrt(w) h,   w = w_below where h < 0, else w_above
    dr/dx = sqrt(w) n^T [-[p - origin]x, I],   dr/dbeta = sqrt(w) n^T (R_i V_j + D_i)
With w_above = 0 it is one-sided; with the probability of contact there it holds standing feet down.
r and, where both weights are equal, dr/dp are continuous at h = 0; the cost and its gradient always
are. Source: a one-sided height keeps the form r_i(T_i, beta) of section 3 of the paper.
"""

import numpy as np

from ..kernel import kernel
from ..matrices import outer
from ..part import Array
from .accumulation import add_to_point, lever, rows_of

INTS = 1  # point, numbered as in the measurements
FLOATS = 6  # n (3), a unit vector, d, w_below, w_above
INDEXES = "points"
WEIGHTS = slice(4, 6)


@kernel
def accumulate(tree, ints, floats, weight, pose, blocks):  # type: ignore[no-untyped-def]
    """Add every row's M, N, m, C, c to the blocks and return the cost. ints (n, 1), floats (n,
    6).
    """
    cost = 0.0
    for k in range(ints.shape[0]):
        f = floats[k]
        j = ints[k, 0]
        x, y, z = lever(tree, pose, j)
        t = pose.t[tree.point_part[j]]
        a = f[0]
        b = f[1]
        c = f[2]
        h = a * (x + t[0]) + b * (y + t[1]) + c * (z + t[2]) - f[3]
        w = weight * (f[4] if h < 0.0 else f[5])
        if w <= 0.0:
            continue
        cost += 0.5 * w * h * h
        add_to_point(
            tree, pose, blocks, j, x, y, z, *outer(w, a, b, c), w * h * a, w * h * b, w * h * c
        )
    return cost


def pack(
    points: Array, normal: Array, offset: Array, w_below: Array, w_above: Array
) -> tuple[Array, Array]:
    """Return the tables of `accumulate`: int64 (n, 1) and float64 (n, 6).

    :param points: (n,) which points, as in the measurements.
    :param normal, offset: of the plane normal^T p = offset in camera axes; (3,), a unit vector
        pointing up, and () metres; or (n, 3) and (n,), of each point's own plane.
    :param w_below: (n,) weights of points that are below the plane. :param w_above: (n,) of those
        above.
    """
    n = len(points)
    planes = np.broadcast_to(normal, (n, 3)), np.broadcast_to(offset, (n,))
    return rows_of(points, *planes, w_below, w_above)
