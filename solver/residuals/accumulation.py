# SPDX-License-Identifier: Apache-2.0
"""What residuals have in common: the robust kernel, and the way from a weight and gradient to the
Gauss-Newton blocks.

The Geman-McClure kernel is
    rho(s) = sigma s / (sigma + s),  s = |r|^2        cost 1/2 w rho(s)
With k = sigma / (sigma + s): rho = s k, rho' = k^2. The kernels take
1/sigma, so that 0 turns it off. First-order reweighting replaces JᵀJ by k^2 JᵀJ.

A residual of a point p fixed to part i, with W = GᵀG and f = Gᵀr for G = dr/dp, adds, with e = p -
origin and B = R_i V + D_i,
    M += [[ [e]x W [e]xᵀ, [e]x W ], [., W]],   N += [[e]x W B ; W B],   m += [e x f ; f],
    C += BᵀWB,   c += Bᵀf
and one of a joint's state adds its Hessian and gradient, turned from the parent's axes to the
camera's. Source: section 3 of the paper.
"""

import numpy as np
from numpy.typing import ArrayLike

from ..kernel import expanded_kernel, kernel
from ..matrices import (
    add3,
    add_cross,
    cross_both,
    cross_symmetric,
    entries,
    product,
    rotated,
    symmetric,
    transposed,
    turned,
)
from ..part import GRADIENT, SHAPE, Array
from ..rotations import log3


def rows_of(indices: ArrayLike, *columns: ArrayLike) -> tuple[Array, Array]:
    """Return the tables of a residual of one whole number a row: int64 (n, 1) and float64 (n, .).

    :param indices: (n,). :param columns: (n,) or (n, m), from left to right.
    """
    floats = np.ascontiguousarray(np.column_stack(columns), dtype=np.float64)
    return np.reshape(indices, (len(floats), 1)).astype(np.int64), floats


@kernel
def geman_mcclure(s: float, inv_sigma: float) -> tuple[float, float]:
    """Return (rho(s), rho'(s)); s in the square of the residual's unit, sigma likewise."""
    k = 1.0 / (1.0 + s * inv_sigma)
    return s * k, k * k


@kernel
def relative_log(h, R):  # type: ignore[no-untyped-def]
    """Return log(H^T R), three numbers; h begins with H (9) by rows, R (3, 3)."""
    return log3(*product(transposed(h), entries(R)))


@kernel
def add_to_joint(  # type: ignore[no-untyped-def]
    tree, pose, blocks, i, h00, h01, h02, h11, h12, h22, g0, g1, g2
):
    """Add a Hessian and a gradient in the parent's axes to joint i: H_uu += R_par H R_parᵀ, g_u +=
    R_par g.
    """
    R = entries(pose.R[tree.parents[i]])
    H = symmetric(turned(R, (h00, h01, h02, h11, h12, h22)))
    g = rotated(R, (g0, g1, g2))
    for r in range(3):
        for s in range(3):
            blocks.H_uu[i, r, s] += H[3 * r + s]
        blocks.H_u[i, r, GRADIENT] += g[r]


@expanded_kernel
def shaped(rest, V, beta, k, P):  # type: ignore[no-untyped-def]
    """Return V_k beta + rest_k of row k of two arrays, with the first P of beta."""
    x = rest[k, 0]
    y = rest[k, 1]
    z = rest[k, 2]
    for a in range(P):
        b = beta[a]
        x += V[k, 0, a] * b
        y += V[k, 1, a] * b
        z += V[k, 2, a] * b
    return x, y, z


@kernel
def lever(tree, pose, k):  # type: ignore[no-untyped-def]
    """Return R_i (V_k beta + v_bar_k), from the part's origin to point k, in camera axes."""
    p = shaped(tree.v_bar, tree.V, pose.beta, k, tree.shape_count)
    return rotated(entries(pose.R[tree.point_part[k]]), p)


@kernel
def shape_derivative(tree, pose, k, i, a):  # type: ignore[no-untyped-def]
    """Return column a of B = R_i V_k + D_i."""
    V = tree.V[k, :, a]
    return add3(rotated(entries(pose.R[i]), V), pose.D[i, :, a])


@expanded_kernel
def add_block(A, y, z, w, m, f):  # type: ignore[no-untyped-def]
    """Add M = [[Y, Z], [Zᵀ, W]], the moment m and the force f to a part's block A (6, 8+W)."""
    Y = symmetric(y)
    W = symmetric(w)
    for r in range(3):
        for s in range(3):
            A[r, s] += Y[3 * r + s]
            A[r, 3 + s] += z[3 * r + s]
            A[3 + s, r] += z[3 * r + s]
            A[3 + r, 3 + s] += W[3 * r + s]
        A[r, GRADIENT] += m[r]
        A[3 + r, GRADIENT] += f[r]


@kernel
def add_to_point(  # type: ignore[no-untyped-def]
    tree, pose, blocks, k, lx, ly, lz, w00, w01, w02, w11, w12, w22, f0, f1, f2
):
    """Add W (its upper triangle) and f of point k, whose `lever` is (lx, ly, lz). One point at a
    time, for the few that touch something; the many that are measured go through linearize.py.
    """
    i = tree.point_part[k]
    A = blocks.A[i]
    t = pose.t[i]
    o = pose.t[0]
    e = (lx + t[0] - o[0], ly + t[1] - o[1], lz + t[2] - o[2])
    w = (w00, w01, w02, w11, w12, w22)
    f = (f0, f1, f2)
    b = cross_symmetric(e, w)
    add_block(A, cross_both(e, b), b, w, add_cross((0.0, 0.0, 0.0), e, f), f)
    for a in range(tree.shape_count):
        B = shape_derivative(tree, pose, k, i, a)
        blocks.c[a] += B[0] * f0 + B[1] * f1 + B[2] * f2
        g = rotated(symmetric(w), B)
        m = add_cross((0.0, 0.0, 0.0), e, g)
        for r in range(3):
            A[r, SHAPE + a] += m[r]
            A[3 + r, SHAPE + a] += g[r]
        for d in range(a, tree.shape_count):
            E = shape_derivative(tree, pose, k, i, d)
            blocks.C[a, d] += g[0] * E[0] + g[1] * E[1] + g[2] * E[2]
