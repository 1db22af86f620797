# SPDX-License-Identifier: Apache-2.0
"""The outline of the body against the contour of a person mask: one signed distance for each point
of the rim.

    r = sqrt(w) d,   d = n^T (pi(p) - m),   p = R_i (V_j beta + v_bar_j + delta) + t_i,
    pi(p) = (x, y) / z
with m the contour point that belongs to p and n its outward normal, both in normalized image
coordinates, and delta what blending the parts' poses adds to the rigid place of the skin, in the
part's axes and held fixed. The kernel has two sides, each with a weight and a scale: outside the
mask, d > 0, a body is wrong; inside, clothes explain some.
    cost = 1/2 w rho(d^2),   (w, sigma) = (w_out, sigma_out) where d > 0, else (w_in, sigma_in)
    dd/dp = (n_x, n_y, -n^T pi(p)) / z
Cost and gradient are continuous at d = 0. A point nearer than z_min is left out. The focal length
is taken as given: the residual adds nothing to its column. Source: section 3 of the paper;
correspondences as in iterative closest points, point to line, renewed by the caller between fits.
"""

import numpy as np

from ..kernel import kernel
from ..matrices import add3, entries, outer, rotated
from ..part import Array
from .accumulation import add_to_point, geman_mcclure, lever, rows_of
from .keypoint2d import Z_MIN

INTS = 1  # point, numbered as in the measurements
FLOATS = 11  # delta (3), m (2), n (2), w_out, w_in, 1/sigma_out, 1/sigma_in
INDEXES = "points"
WEIGHTS = slice(7, 9)


@kernel
def accumulate(tree, ints, floats, weight, pose, blocks):  # type: ignore[no-untyped-def]
    """Add every row's M, N, m, C, c to the blocks and return the cost. ints (n, 1), floats (n,
    11).
    """
    cost = 0.0
    for k in range(ints.shape[0]):
        f = floats[k]
        j = ints[k, 0]
        i = tree.point_part[j]
        t = pose.t[i]
        lx, ly, lz = add3(lever(tree, pose, j), rotated(entries(pose.R[i]), f))
        z = lz + t[2]
        if z <= Z_MIN:
            continue
        u = (lx + t[0]) / z
        v = (ly + t[1]) / z
        d = f[5] * (u - f[3]) + f[6] * (v - f[4])
        side = 0 if d > 0.0 else 1
        rho, w = geman_mcclure(d * d, f[9 + side])
        cost += 0.5 * weight * f[7 + side] * rho
        w *= weight * f[7 + side]
        if w <= 0.0:
            continue
        a = f[5] / z
        b = f[6] / z
        c = -(f[5] * u + f[6] * v) / z
        add_to_point(
            tree, pose, blocks, j, lx, ly, lz, *outer(w, a, b, c), w * d * a, w * d * b, w * d * c
        )
    return cost


def pack(
    points: Array,
    delta: Array,
    contour: Array,
    normal: Array,
    weights: tuple[Array, Array],
    sigmas: tuple[Array, Array],
) -> tuple[Array, Array]:
    """Return the tables of `accumulate`: int64 (n, 1) and float64 (n, 11).

    :param points: (n,) which points, as in the measurements.
    :param delta: (n, 3) offsets in the axes of their parts, metres.
    :param contour, normal: (n, 2) contour points and unit outward normals, normalized image
        coordinates.
    :param weights, sigmas: (n,) each outside and inside the mask; sigma is the square of a
        distance.
    """
    inverse = [1.0 / np.asarray(sigma) for sigma in sigmas]
    return rows_of(points, delta, contour, normal, *weights, *inverse)
