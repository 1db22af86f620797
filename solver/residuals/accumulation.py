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
    return log3(
        h[0] * R[0, 0] + h[3] * R[1, 0] + h[6] * R[2, 0],
        h[0] * R[0, 1] + h[3] * R[1, 1] + h[6] * R[2, 1],
        h[0] * R[0, 2] + h[3] * R[1, 2] + h[6] * R[2, 2],
        h[1] * R[0, 0] + h[4] * R[1, 0] + h[7] * R[2, 0],
        h[1] * R[0, 1] + h[4] * R[1, 1] + h[7] * R[2, 1],
        h[1] * R[0, 2] + h[4] * R[1, 2] + h[7] * R[2, 2],
        h[2] * R[0, 0] + h[5] * R[1, 0] + h[8] * R[2, 0],
        h[2] * R[0, 1] + h[5] * R[1, 1] + h[8] * R[2, 1],
        h[2] * R[0, 2] + h[5] * R[1, 2] + h[8] * R[2, 2],
    )


@kernel
def add_to_joint(  # type: ignore[no-untyped-def]
    tree, pose, blocks, i, h00, h01, h02, h11, h12, h22, g0, g1, g2
):
    """Add a Hessian and a gradient in the parent's axes to joint i: H_uu += R_par H R_parᵀ, g_u +=
    R_par g.
    """
    R = pose.R[tree.parents[i]]
    for r in range(3):
        x = R[r, 0]
        y = R[r, 1]
        z = R[r, 2]
        a = x * h00 + y * h01 + z * h02
        b = x * h01 + y * h11 + z * h12
        c = x * h02 + y * h12 + z * h22
        for s in range(3):
            blocks.H_uu[i, r, s] += a * R[s, 0] + b * R[s, 1] + c * R[s, 2]
        blocks.H_u[i, r, GRADIENT] += x * g0 + y * g1 + z * g2


@expanded_kernel
def outer(w, a, b, c):  # type: ignore[no-untyped-def]
    """Return the upper triangle of w (a, b, c)ᵀ(a, b, c) by rows, six numbers."""
    return w * a * a, w * a * b, w * a * c, w * b * b, w * b * c, w * c * c


@kernel
def lever(tree, pose, k):  # type: ignore[no-untyped-def]
    """Return R_i (V_k beta + v_bar_k), from the part's origin to point k, in camera axes."""
    x = tree.v_bar[k, 0]
    y = tree.v_bar[k, 1]
    z = tree.v_bar[k, 2]
    for a in range(tree.shape):
        b = pose.beta[a]
        x += tree.V[k, 0, a] * b
        y += tree.V[k, 1, a] * b
        z += tree.V[k, 2, a] * b
    R = pose.R[tree.point_part[k]]
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@kernel
def _shape_derivative(tree, pose, k, i, a):  # type: ignore[no-untyped-def]
    """Return column a of B = R_i V_k + D_i."""
    R = pose.R[i]
    D = pose.D[i]
    x = tree.V[k, 0, a]
    y = tree.V[k, 1, a]
    z = tree.V[k, 2, a]
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + D[0, a],
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + D[1, a],
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + D[2, a],
    )


@kernel
def add_to_point(  # type: ignore[no-untyped-def]
    tree, pose, blocks, k, lx, ly, lz, w00, w01, w02, w11, w12, w22, f0, f1, f2
):
    """Add W (its upper triangle) and f of point k, whose `lever` is (lx, ly, lz). One point at a
    time, for the few that touch something; the many that are measured go through linearize.py.
    """
    i = tree.point_part[k]
    A = blocks.A[i]
    C = blocks.C
    c = blocks.c
    t = pose.t[i]
    o = pose.t[0]
    x = lx + t[0] - o[0]
    y = ly + t[1] - o[1]
    z = lz + t[2] - o[2]
    W = ((w00, w01, w02), (w01, w11, w12), (w02, w12, w22))
    for s in range(3):
        # column s of W, of [e]x W, and of [e]x W [e]xT = -[e]x W [e]x
        A[3, 3 + s] += W[0][s]
        A[4, 3 + s] += W[1][s]
        A[5, 3 + s] += W[2][s]
    b00 = y * w02 - z * w01
    b01 = y * w12 - z * w11
    b02 = y * w22 - z * w12
    b10 = z * w00 - x * w02
    b11 = z * w01 - x * w12
    b12 = z * w02 - x * w22
    b20 = x * w01 - y * w00
    b21 = x * w11 - y * w01
    b22 = x * w12 - y * w02
    corner = ((b00, b01, b02), (b10, b11, b12), (b20, b21, b22))
    for r in range(3):
        for s in range(3):
            A[r, 3 + s] += corner[r][s]
            A[3 + s, r] += corner[r][s]
        b0, b1, b2 = corner[r]
        A[r, 0] += y * b2 - z * b1
        A[r, 1] += z * b0 - x * b2
        A[r, 2] += x * b1 - y * b0
    A[0, GRADIENT] += y * f2 - z * f1
    A[1, GRADIENT] += z * f0 - x * f2
    A[2, GRADIENT] += x * f1 - y * f0
    A[3, GRADIENT] += f0
    A[4, GRADIENT] += f1
    A[5, GRADIENT] += f2
    for a in range(tree.shape):
        B0, B1, B2 = _shape_derivative(tree, pose, k, i, a)
        c[a] += B0 * f0 + B1 * f1 + B2 * f2
        g0 = w00 * B0 + w01 * B1 + w02 * B2
        g1 = w01 * B0 + w11 * B1 + w12 * B2
        g2 = w02 * B0 + w12 * B1 + w22 * B2
        A[0, SHAPE + a] += y * g2 - z * g1
        A[1, SHAPE + a] += z * g0 - x * g2
        A[2, SHAPE + a] += x * g1 - y * g0
        A[3, SHAPE + a] += g0
        A[4, SHAPE + a] += g1
        A[5, SHAPE + a] += g2
        for b in range(a, tree.shape):
            E0, E1, E2 = _shape_derivative(tree, pose, k, i, b)
            C[a, b] += g0 * E0 + g1 * E1 + g2 * E2
