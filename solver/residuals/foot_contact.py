# SPDX-License-Identifier: Apache-2.0
"""A point that stands still: a heel or toe in contact has no velocity, so it is where it was.

    r = sqrt(w) (p - p_stand),   p = R_i (V_j beta + v_bar_j) + t_i,   metres
    dr/dx = sqrt(w) [-[p - origin]x, I],   dr/dbeta = sqrt(w) (R_i V_j + D_i)
p_stand is a constant, last frame's position or the mean over the contact, in the camera frame of
this frame; w is the probability of contact. Without a robust kernel: contact is uncertain through
w, not through outliers. Source: velocity terms whose last frame is a constant keep the form
r_i(T_i, beta) of section 3 of the paper.
"""

from ..kernel import kernel
from ..part import Array
from .accumulation import add_to_point, lever, rows_of

INTS = 1  # point, numbered as in the measurements
FLOATS = 4  # p_stand (3), w
INDEXES = "points"
WEIGHTS = slice(3, 4)


@kernel
def accumulate(tree, ints, floats, weight, pose, blocks):  # type: ignore[no-untyped-def]
    """Add every row's M, N, m, C, c to the blocks and return the cost. ints (n, 1), floats (n,
    4).
    """
    cost = 0.0
    for k in range(ints.shape[0]):
        f = floats[k]
        w = weight * f[3]
        if w <= 0.0:
            continue
        j = ints[k, 0]
        x, y, z = lever(tree, pose, j)
        t = pose.t[tree.point_part[j]]
        r0 = x + t[0] - f[0]
        r1 = y + t[1] - f[1]
        r2 = z + t[2] - f[2]
        cost += 0.5 * w * (r0 * r0 + r1 * r1 + r2 * r2)
        add_to_point(tree, pose, blocks, j, x, y, z, w, 0.0, 0.0, w, 0.0, w, w * r0, w * r1, w * r2)
    return cost


def pack(points: Array, p_stand: Array, weights: Array) -> tuple[Array, Array]:
    """Return the tables of `accumulate` from points (n,), positions (n, 3) and weights (n,)."""
    return rows_of(points, p_stand, weights)
