# SPDX-License-Identifier: GPL-3.0-or-later
"""The Gauss-Newton step in O(K): eliminate the joints from the leaves to the root, solve 6 + P, substitute back.

Twists x_i are in camera axes about the pelvis o = t_0, so a parent's twist passes to its child unchanged:
    x_i = x_par + U_i u_i,  U_i = [I; [t_i - o]x]
and with Y = UᵀM + H_ux, E = UᵀN + H_ubeta, q = Uᵀm + g_u for the joint's row of the normal equations,
    Q = UᵀMU + H_uu + H_ux U + Uᵀ H_uxᵀ + lambda I = L Lᵀ,   (Y~, E~, q~) = L^-1 (Y, E, q)
    M_par += M - Y~ᵀY~   N_par += N - Y~ᵀE~   m_par += m - Y~ᵀq~   C -= E~ᵀE~   c -= E~ᵀq~
    u_i = -L^-ᵀ (q~ + Y~ x_par + E~ dbeta)
The root is damped by lambda (|w|^2 + s^2 |nu|^2), nu being the motion of the pelvis, beta not at all.
Nothing larger than the number of global columns (P, or P + 1 with the focal length) or 6 is factorized.
"""

import math
from typing import NamedTuple

import numpy as np

from .kernel import kernel
from .residuals.part import GRADIENT, SHAPE, Array, Blocks, Pose
from .rotations import exp3
from .rows import add1, add3, add_block, set_block
from .tree import Tree

TINY = 1e-13  # a pivot below this share of its diagonal is no information: that direction stays where it is


class Workspace(NamedTuple):
    """Everything an elimination leaves behind for the substitution. W as in `Tree`."""

    A: Array  # (K+1, 6, 8+W), sums over subtrees
    Y: Array  # (K+1, 3, 8+W), [Y~ | q~ | 0 | E~]
    L: Array  # (K+1, 6), the inverse of L by rows of its lower triangle
    root: Array  # (6, 6), Cholesky factor of the damped M_0
    N: Array  # (6, 8+W), L_root^-1 [. | m_0 | 0 | N_0]
    C: Array  # (W, W), full; after `eliminate` the reduced system of the frame, then its factor
    c: Array  # (W,)
    x: Array  # (K+1, 6), twists
    u: Array  # (K+1, 3), joint increments
    dbeta: Array  # (W,)
    scratch: Array  # (9, W)


def make_workspace(tree: Tree) -> Workspace:
    """Return a workspace of zeros for `tree`."""
    n, w = len(tree.parents), tree.S.shape[2]
    row = SHAPE + w
    shapes = ((n, 6, row), (n, 3, row), (n, 6), (6, 6), (6, row), (w, w), (w,), (n, 6), (n, 3), (w,), (9, w))
    return Workspace(*(np.zeros(shape) for shape in shapes))


@kernel
def cholesky(H, n: int) -> None:  # type: ignore[no-untyped-def]
    """Factorize the lower triangle of H (n, n) in place, H = L Lᵀ, with 1 / L_ii on the diagonal.

    A pivot that is not positive to rounding gets 0 for its inverse, so that its unknown becomes 0.
    """
    for j in range(n):
        floor = TINY * abs(H[j, j])
        d = H[j, j]
        for k in range(j):
            d -= H[j, k] * H[j, k]
        inverse = 1.0 / math.sqrt(d) if d > floor and d > 1e-290 else 0.0
        H[j, j] = inverse
        for i in range(j + 1, n):
            s = H[i, j]
            for k in range(j):
                s -= H[i, k] * H[j, k]
            H[i, j] = s * inverse


@kernel
def eliminate(tree: Tree, pose: Pose, blocks: Blocks, damping: float, root_scale: float, work: Workspace) -> float:
    """Eliminate all joints and the root's pose; leave the reduced system of the global columns in work.C, work.c.

    Returns the sum of |q~|^2, the part of the predicted decrease that is due to what was eliminated.
    `root_scale` is s, in radians per metre. The blocks are kept, to be eliminated again with another damping.
    """
    A, Y, L, C, c = work.A, work.Y, work.L, work.C, work.c
    W = c.shape[0]
    row = SHAPE + W
    n, P = tree.parents.shape[0], tree.globals
    A[:] = blocks.A
    for a in range(P):
        c[a] = blocks.c[a]
        for b in range(W):
            C[a, b] = blocks.C[a, b]
    ox, oy, oz = pose.t[0, 0], pose.t[0, 1], pose.t[0, 2]
    squares = 0.0
    for i in range(n - 1, 0, -1):
        sx, sy, sz = pose.t[i, 0] - ox, pose.t[i, 1] - oy, pose.t[i, 2] - oz
        base, y = 6 * i * row, 3 * i * row
        # UT A = moment about the joint: A_ang - s x A_lin, plus the joint's own row
        set_block(Y, y, row, (0.0, sz, -sy, -sz, 0.0, sx, sy, -sx, 0.0), A, base + 3 * row, row, row)
        add1(Y, y, 1.0, A, base, 3 * row)
        add1(Y, y, 1.0, blocks.H_u, y, 3 * row)
        T = Y[i]
        H = blocks.H_uu[i]
        # Q = Y U + H_uu + lambda I (+ UT H_uxT)
        q00 = T[0, 0] + T[0, 5] * -sy + T[0, 4] * sz + H[0, 0] + damping
        q10 = T[1, 0] + T[1, 4] * sz - T[1, 5] * sy + H[1, 0]
        q11 = T[1, 1] + T[1, 5] * sx - T[1, 3] * sz + H[1, 1] + damping
        q20 = T[2, 0] + T[2, 4] * sz - T[2, 5] * sy + H[2, 0]
        q21 = T[2, 1] + T[2, 5] * sx - T[2, 3] * sz + H[2, 1]
        q22 = T[2, 2] + T[2, 3] * sy - T[2, 4] * sx + H[2, 2] + damping
        if blocks.cross[0]:
            B = blocks.H_u[i]
            q00 += B[0, 0] + sz * B[0, 4] - sy * B[0, 5]
            q10 += B[0, 1] + sx * B[0, 5] - sz * B[0, 3]
            q11 += B[1, 1] + sx * B[1, 5] - sz * B[1, 3]
            q20 += B[0, 2] + sy * B[0, 3] - sx * B[0, 4]
            q21 += B[1, 2] + sy * B[1, 3] - sx * B[1, 4]
            q22 += B[2, 2] + sy * B[2, 3] - sx * B[2, 4]
        i00 = 1.0 / math.sqrt(q00) if q00 > 1e-290 else 0.0
        l10, l20 = q10 * i00, q20 * i00
        d = q11 - l10 * l10
        i11 = 1.0 / math.sqrt(d) if d > TINY * q11 else 0.0
        l21 = (q21 - l20 * l10) * i11
        d = q22 - l20 * l20 - l21 * l21
        i22 = 1.0 / math.sqrt(d) if d > TINY * q22 else 0.0
        i10 = -l10 * i00 * i11
        i21 = -l21 * i11 * i22
        i20 = -(l20 * i00 + l21 * i10) * i22
        F = L[i]
        F[0], F[1], F[2], F[3], F[4], F[5] = i00, i10, i11, i20, i21, i22
        set_block(Y, y, row, (i00, 0.0, 0.0, i10, i11, 0.0, i20, i21, i22), Y, y, row, row)
        g0, g1, g2 = T[0, GRADIENT], T[1, GRADIENT], T[2, GRADIENT]
        squares += g0 * g0 + g1 * g1 + g2 * g2
        to = 6 * tree.parents[i] * row
        add1(A, to, 1.0, A, base, 6 * row)
        for r in range(0, 6, 3):
            minus = (
                -T[0, r], -T[1, r], -T[2, r],
                -T[0, r + 1], -T[1, r + 1], -T[2, r + 1],
                -T[0, r + 2], -T[1, r + 2], -T[2, r + 2],
            )  # fmt: skip
            add_block(A, to + r * row, row, minus, Y, y, row, row)
        e = y + SHAPE
        add3(c, 0, -g0, -g1, -g2, Y, e, e + row, e + 2 * row, W)
        for a in range(P):
            s = a & ~3
            add3(
                C, a * W + s, -T[0, SHAPE + a], -T[1, SHAPE + a], -T[2, SHAPE + a],
                Y, e + s, e + row + s, e + 2 * row + s, W - s,
            )  # fmt: skip
    M, N = work.root, work.N
    for r in range(6):
        for k in range(r + 1):
            M[r, k] = A[0, r, k]
        M[r, r] += damping if r < 3 else damping * root_scale * root_scale
    cholesky(M, 6)
    for r in range(6):
        for k in range(GRADIENT, row):
            N[r, k] = A[0, r, k]
        for j in range(r):
            add1(N, r * row + SHAPE, -M[r, j], N, j * row + SHAPE, W)
            N[r, GRADIENT] -= M[r, j] * N[j, GRADIENT]
        for k in range(GRADIENT, row):
            N[r, k] *= M[r, r]
        g = N[r, GRADIENT]
        squares += g * g
        add1(c, 0, -g, N, r * row + SHAPE, W)
        for a in range(P):
            add1(C, a * W, -N[r, SHAPE + a], N, r * row + SHAPE, W)
    for a in range(P):
        for b in range(a):
            C[a, b] = C[b, a]
    return squares


@kernel
def solve_globals(tree: Tree, C, c, dbeta) -> float:  # type: ignore[no-untyped-def]
    """Solve C dbeta = -c for the global columns, overwriting C with its factor; return |L^-1 c|^2."""
    P = tree.globals
    cholesky(C, P)
    squares = 0.0
    for a in range(P):
        s = -c[a]
        for b in range(a):
            s -= C[a, b] * dbeta[b]
        dbeta[a] = s * C[a, a]
        squares += dbeta[a] * dbeta[a]
    for a in range(P - 1, -1, -1):
        s = dbeta[a]
        for b in range(a + 1, P):
            s -= C[b, a] * dbeta[b]
        dbeta[a] = s * C[a, a]
    return squares


@kernel
def substitute(tree: Tree, pose: Pose, damping: float, root_scale: float, work: Workspace) -> float:
    """Fill work.x and work.u from work.dbeta, and return dᵀ Lambda d of the damping that was added."""
    x, u, Y, N, M, dbeta = work.x, work.u, work.Y, work.N, work.root, work.dbeta
    P = tree.globals
    for r in range(6):
        s = -N[r, GRADIENT]
        for a in range(P):
            s -= N[r, SHAPE + a] * dbeta[a]
        x[0, r] = s
    for r in range(5, -1, -1):
        s = x[0, r]
        for j in range(r + 1, 6):
            s -= M[j, r] * x[0, j]
        x[0, r] = s * M[r, r]
    ox, oy, oz = pose.t[0, 0], pose.t[0, 1], pose.t[0, 2]
    squares = x[0, 0] ** 2 + x[0, 1] ** 2 + x[0, 2] ** 2
    squares += root_scale**2 * (x[0, 3] ** 2 + x[0, 4] ** 2 + x[0, 5] ** 2)
    for i in range(1, tree.parents.shape[0]):
        T, z, F = Y[i], x[tree.parents[i]], work.L[i]
        s0, s1, s2 = T[0, GRADIENT], T[1, GRADIENT], T[2, GRADIENT]
        for k in range(6):
            s0 += T[0, k] * z[k]
            s1 += T[1, k] * z[k]
            s2 += T[2, k] * z[k]
        for a in range(P):
            s0 += T[0, SHAPE + a] * dbeta[a]
            s1 += T[1, SHAPE + a] * dbeta[a]
            s2 += T[2, SHAPE + a] * dbeta[a]
        u0, u1, u2 = -(F[0] * s0 + F[1] * s1 + F[3] * s2), -(F[2] * s1 + F[4] * s2), -F[5] * s2
        u[i, 0], u[i, 1], u[i, 2] = u0, u1, u2
        squares += u0 * u0 + u1 * u1 + u2 * u2
        sx, sy, sz = pose.t[i, 0] - ox, pose.t[i, 1] - oy, pose.t[i, 2] - oz
        x[i, 0], x[i, 1], x[i, 2] = z[0] + u0, z[1] + u1, z[2] + u2
        x[i, 3] = z[3] + sy * u2 - sz * u1
        x[i, 4] = z[4] + sz * u0 - sx * u2
        x[i, 5] = z[5] + sx * u1 - sy * u0
    return damping * squares


@kernel
def step(tree: Tree, pose: Pose, blocks: Blocks, damping: float, root_scale: float, work: Workspace) -> float:
    """Fill work.x, work.u, work.dbeta with the damped Gauss-Newton step and return the decrease it predicts.

    For (H + Lambda) d = -g the decrease of 1/2 dᵀHd + gᵀd is 1/2 |L^-1 g|^2 + 1/2 dᵀ Lambda d.
    """
    squares = eliminate(tree, pose, blocks, damping, root_scale, work)
    squares += solve_globals(tree, work.C, work.c, work.dbeta)
    return 0.5 * (squares + substitute(tree, pose, damping, root_scale, work))


@kernel
def retract(tree: Tree, pose: Pose, work: Workspace, trial: Pose) -> None:
    """Write the moved pose to `trial`: R_0 <- exp(w) R_0, t_0 <- t_0 + nu, Omega <- exp(R_parᵀ u) Omega.

    R, t and D of the other parts are left to `place_parts`.
    """
    x, u = work.x, work.u
    for i in range(tree.parents.shape[0]):
        if i == 0:
            E = exp3(x[0, 0], x[0, 1], x[0, 2])
            old, new = pose.R[0], trial.R[0]
        else:
            R = pose.R[tree.parents[i]]
            E = exp3(
                R[0, 0] * u[i, 0] + R[1, 0] * u[i, 1] + R[2, 0] * u[i, 2],
                R[0, 1] * u[i, 0] + R[1, 1] * u[i, 1] + R[2, 1] * u[i, 2],
                R[0, 2] * u[i, 0] + R[1, 2] * u[i, 1] + R[2, 2] * u[i, 2],
            )
            old, new = pose.Omega[i], trial.Omega[i]
        for k in range(3):
            a, b, d = old[0, k], old[1, k], old[2, k]
            new[0, k] = E[0] * a + E[1] * b + E[2] * d
            new[1, k] = E[3] * a + E[4] * b + E[5] * d
            new[2, k] = E[6] * a + E[7] * b + E[8] * d
    for r in range(3):
        trial.t[0, r] = pose.t[0, r] + x[0, 3 + r]
    for a in range(tree.shape):
        trial.beta[a] = pose.beta[a] + work.dbeta[a]
    trial.log_focal[0] = pose.log_focal[0]
    if tree.globals > tree.shape:
        trial.log_focal[0] += work.dbeta[tree.shape]
