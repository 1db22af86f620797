# SPDX-License-Identifier: Apache-2.0
"""The Gauss-Newton step in O(K): eliminate the joints from the leaves to the root, solve 6 + P,
substitute back.

Twists x_i are in camera axes about the pelvis o = t_0, so a parent's twist passes to its child
unchanged:
    x_i = x_par + U_i u_i,  U_i = [I; [t_i - o]x]
and with Y = UᵀM + H_ux, E = UᵀN + H_ubeta, q = Uᵀm + g_u for the joint's row of the normal
equations,
    Q = UᵀMU + H_uu + H_ux U + Uᵀ H_uxᵀ + lambda I = L Lᵀ,   (Y~, E~, q~) = L^-1 (Y, E, q)
    M_par += M - Y~ᵀY~   N_par += N - Y~ᵀE~   m_par += m - Y~ᵀq~   C -= E~ᵀE~   c -= E~ᵀq~
    u_i = -L^-ᵀ (q~ + Y~ x_par + E~ dbeta)
The root is damped by lambda (|w|^2 + s^2 |nu|^2), nu being the motion of the pelvis, beta not at
all. Nothing larger than the number of global columns (P, or P + 1 with the focal length) or 6 is
factorized.
"""

import math
from typing import NamedTuple

import numpy as np

from ..kernel import expanded_kernel, kernel
from ..matrices import entries, product, rotated, transposed, write_entries
from ..part import GRADIENT, SHAPE, Array, Blocks, Pose
from ..rotations import exp3
from ..tree import Tree
from .linearize import make_scratch
from .rows import add_to_parent, scale_rows, subtract_eliminated, take_moment

# a pivot below this share of its diagonal is no information: that direction stays where it is
TINY = 1e-13


class Workspace(NamedTuple):
    """Everything an elimination leaves behind for the substitution. W as in `Tree`."""

    A: Array  # (K+1, 6, 8+W), sums over subtrees
    Y: Array  # (K+1, 3, 8+W), [Y~ | q~ | 0 | E~]
    L: Array  # (K+1, 6), the inverse of L by rows of its lower triangle
    # (6, 8+W), L_0^-1 [M_0 + Lambda | m_0 | 0 | N_0]: L_0ᵀ in its upper triangle, 1/L_ii on the
    # diagonal
    root: Array
    C: Array  # (W, W), full; after `eliminate` the reduced system of the frame, then its factor
    c: Array  # (W,)
    x: Array  # (K+1, 6), twists
    u: Array  # (K+1, 3), joint increments
    dbeta: Array  # (W,)
    scratch: Array  # of `linearize`


def make_workspace(tree: Tree) -> Workspace:
    """Return a workspace of zeros for `tree`."""
    n = len(tree.parents)
    w = tree.S.shape[2]
    row = SHAPE + w
    shapes: list[tuple[int, ...]] = [
        (n, 6, row),
        (n, 3, row),
        (n, 6),
        (6, row),
        (w, w),
        (w,),
        (n, 6),
        (n, 3),
        (w,),
    ]
    return Workspace(*[np.zeros(shape) for shape in shapes] + [make_scratch(tree)])


@kernel
def copy_rows(source, target) -> None:  # type: ignore[no-untyped-def]
    """Write rows (m, n) to others; an assignment of slices would allocate memory."""
    for r in range(source.shape[0]):
        for k in range(source.shape[1]):
            target[r, k] = source[r, k]


@kernel
def subtract_row(row, share, target) -> None:  # type: ignore[no-untyped-def]
    """Subtract share times a row (n,) from another: the compiler makes SIMD of it, unlike of two
    rows of one matrix.
    """
    for k in range(target.shape[0]):
        target[k] -= share * row[k]


@kernel
def factorize(H, n: int, diagonal) -> None:  # type: ignore[no-untyped-def]
    """Replace the rows [H | rest] (n, .), H (n, n) symmetric, by L^-1 [H | rest], H = L Lᵀ.

    Only the upper triangle is read, and L_ii^-1 is put on the diagonal. A pivot that is not
    positive to rounding gets 0 for its inverse, so that its unknown becomes 0. diagonal (n,) is
    overwritten.
    """
    for j in range(n):
        diagonal[j] = H[j, j]
    for j in range(n):
        d = H[j, j]
        inverse = 1.0 / math.sqrt(d) if d > TINY * abs(diagonal[j]) and d > 1e-290 else 0.0
        for i in range(j + 1, n):
            share = H[j, i] * inverse * inverse
            subtract_row(H[j, i:], share, H[i, i:])
        for k in range(j, H.shape[1]):
            H[j, k] *= inverse
        H[j, j] = inverse


@expanded_kernel
def _joint_block(T, blocks, i, s, damping):  # type: ignore[no-untyped-def]
    """Add joint i's [H_ux | g_u | 0 | H_ubeta] to T (3, 8+W), which has UᵀM and so on, and return
    Q by rows of its lower triangle; s (3): t_i - o.
    """
    H = blocks.H_uu[i]
    B = blocks.H_u[i]
    sx, sy, sz = s
    if blocks.cross[0]:
        for r in range(3):
            for k in range(T.shape[1]):
                T[r, k] += B[r, k]
    else:
        for r in range(3):
            T[r, GRADIENT] += B[r, GRADIENT]
    # Q = Y U + H_uu + lambda I (+ UT H_uxT)
    q00 = T[0, 0] + T[0, 5] * -sy + T[0, 4] * sz + H[0, 0] + damping
    q10 = T[1, 0] + T[1, 4] * sz - T[1, 5] * sy + H[1, 0]
    q11 = T[1, 1] + T[1, 5] * sx - T[1, 3] * sz + H[1, 1] + damping
    q20 = T[2, 0] + T[2, 4] * sz - T[2, 5] * sy + H[2, 0]
    q21 = T[2, 1] + T[2, 5] * sx - T[2, 3] * sz + H[2, 1]
    q22 = T[2, 2] + T[2, 3] * sy - T[2, 4] * sx + H[2, 2] + damping
    if blocks.cross[0]:
        q00 += B[0, 0] + sz * B[0, 4] - sy * B[0, 5]
        q10 += B[0, 1] + sx * B[0, 5] - sz * B[0, 3]
        q11 += B[1, 1] + sx * B[1, 5] - sz * B[1, 3]
        q20 += B[0, 2] + sy * B[0, 3] - sx * B[0, 4]
        q21 += B[1, 2] + sy * B[1, 3] - sx * B[1, 4]
        q22 += B[2, 2] + sy * B[2, 3] - sx * B[2, 4]
    return q00, q10, q11, q20, q21, q22


@expanded_kernel
def inverse_factor3(q):  # type: ignore[no-untyped-def]
    """Return L^-1 with L Lᵀ = Q, both by rows of their lower triangles (6); a pivot that is not
    positive to rounding gets 0 for its inverse, as in `factorize`.
    """
    q00, q10, q11, q20, q21, q22 = q
    i00 = 1.0 / math.sqrt(q00) if q00 > 1e-290 else 0.0
    l10 = q10 * i00
    l20 = q20 * i00
    d = q11 - l10 * l10
    i11 = 1.0 / math.sqrt(d) if d > TINY * q11 else 0.0
    l21 = (q21 - l20 * l10) * i11
    d = q22 - l20 * l20 - l21 * l21
    i22 = 1.0 / math.sqrt(d) if d > TINY * q22 else 0.0
    i10 = -l10 * i00 * i11
    i21 = -l21 * i11 * i22
    i20 = -(l20 * i00 + l21 * i10) * i22
    return i00, i10, i11, i20, i21, i22


@kernel
def eliminate(
    tree: Tree, pose: Pose, blocks: Blocks, damping: float, root_scale: float, work: Workspace
) -> float:
    """Eliminate all joints and the root's pose; leave the reduced system of the global columns in
    work.C, work.c.

    Returns the sum of |q~|^2, the part of the predicted decrease that is due to what was
    eliminated. `root_scale` is s, in radians per metre. The blocks are kept, to be eliminated again
    with another damping.
    """
    C = work.C
    c = work.c
    n = tree.parents.shape[0]
    for i in range(n):
        copy_rows(blocks.A[i], work.A[i])
    copy_rows(blocks.C, C)
    for a in range(c.shape[0]):
        c[a] = blocks.c[a]
    ox = pose.t[0, 0]
    oy = pose.t[0, 1]
    oz = pose.t[0, 2]
    squares = 0.0
    for i in range(n - 1, 0, -1):
        s = (pose.t[i, 0] - ox, pose.t[i, 1] - oy, pose.t[i, 2] - oz)
        A = work.A[i]
        T = work.Y[i]
        take_moment(A, s, T)
        q = _joint_block(T, blocks, i, s, damping)
        F = inverse_factor3(q)
        for k in range(6):
            work.L[i, k] = F[k]
        scale_rows(F, T)
        squares += T[0, GRADIENT] ** 2 + T[1, GRADIENT] ** 2 + T[2, GRADIENT] ** 2
        add_to_parent(A, T, work.A[tree.parents[i]])
        subtract_eliminated(T, C, c)
    root = work.root
    copy_rows(work.A[0], root)
    for r in range(6):
        root[r, r] += damping if r < 3 else damping * root_scale * root_scale
    factorize(root, 6, work.x[0])
    for r in range(6):
        squares += root[r, GRADIENT] ** 2
    subtract_eliminated(root, C, c)
    for a in range(tree.global_count):
        for b in range(a):
            C[a, b] = C[b, a]
    return squares


@kernel
def solve_globals(tree: Tree, C, c, dbeta) -> float:  # type: ignore[no-untyped-def]
    """Solve C dbeta = -c for the global columns, overwriting C with its factor; return |L^-1
    c|^2.
    """
    P = tree.global_count
    factorize(C, P, dbeta)
    for a in range(P):
        dbeta[a] = -c[a]
    squares = 0.0
    for a in range(P):
        y = dbeta[a] * C[a, a]
        squares += y * y
        for b in range(a + 1, P):
            dbeta[b] -= C[a, b] * y
        dbeta[a] = y
    for a in range(P - 1, -1, -1):
        s = dbeta[a]
        for b in range(a + 1, P):
            s -= C[a, b] * dbeta[b]
        dbeta[a] = s * C[a, a]
    return squares


@kernel
def substitute(tree: Tree, pose: Pose, damping: float, root_scale: float, work: Workspace) -> float:
    """Fill work.x and work.u from work.dbeta, and return dᵀ Lambda d of the damping that was
    added.
    """
    x = work.x
    u = work.u
    Y = work.Y
    root = work.root
    dbeta = work.dbeta
    P = tree.global_count
    for r in range(5, -1, -1):
        s = -root[r, GRADIENT]
        for a in range(P):
            s -= root[r, SHAPE + a] * dbeta[a]
        for j in range(r + 1, 6):
            s -= root[r, j] * x[0, j]
        x[0, r] = s * root[r, r]
    ox = pose.t[0, 0]
    oy = pose.t[0, 1]
    oz = pose.t[0, 2]
    squares: float = x[0, 0] ** 2 + x[0, 1] ** 2 + x[0, 2] ** 2
    squares += root_scale**2 * (x[0, 3] ** 2 + x[0, 4] ** 2 + x[0, 5] ** 2)
    for i in range(1, tree.parents.shape[0]):
        T = Y[i]
        z = x[tree.parents[i]]
        F = work.L[i]
        s0 = T[0, GRADIENT]
        s1 = T[1, GRADIENT]
        s2 = T[2, GRADIENT]
        for k in range(6):
            s0 += T[0, k] * z[k]
            s1 += T[1, k] * z[k]
            s2 += T[2, k] * z[k]
        for a in range(P):
            s0 += T[0, SHAPE + a] * dbeta[a]
            s1 += T[1, SHAPE + a] * dbeta[a]
            s2 += T[2, SHAPE + a] * dbeta[a]
        u0 = -(F[0] * s0 + F[1] * s1 + F[3] * s2)
        u1 = -(F[2] * s1 + F[4] * s2)
        u2 = -F[5] * s2
        u[i, 0] = u0
        u[i, 1] = u1
        u[i, 2] = u2
        squares += u0 * u0 + u1 * u1 + u2 * u2
        sx = pose.t[i, 0] - ox
        sy = pose.t[i, 1] - oy
        sz = pose.t[i, 2] - oz
        x[i, 0] = z[0] + u0
        x[i, 1] = z[1] + u1
        x[i, 2] = z[2] + u2
        x[i, 3] = z[3] + sy * u2 - sz * u1
        x[i, 4] = z[4] + sz * u0 - sx * u2
        x[i, 5] = z[5] + sx * u1 - sy * u0
    damped: float = damping * squares
    return damped


@kernel
def step(
    tree: Tree, pose: Pose, blocks: Blocks, damping: float, root_scale: float, work: Workspace
) -> float:
    """Fill work.x, work.u, work.dbeta with the damped Gauss-Newton step and return the decrease it
    predicts.

    For (H + Lambda) d = -g the decrease of 1/2 dᵀHd + gᵀd is 1/2 |L^-1 g|^2 + 1/2 dᵀ Lambda d.
    """
    squares = eliminate(tree, pose, blocks, damping, root_scale, work)
    squares += solve_globals(tree, work.C, work.c, work.dbeta)
    decrease: float = 0.5 * (squares + substitute(tree, pose, damping, root_scale, work))
    return decrease


@kernel
def retract(tree: Tree, pose: Pose, work: Workspace, trial: Pose) -> None:
    """Write the pose moved by the step in `work` to `trial`: see `move`."""
    move(tree, pose, work.x[0], work.u, work.dbeta, trial)


@expanded_kernel
def move(tree, pose, x, u, dg, trial):  # type: ignore[no-untyped-def]
    """Write the moved pose to `trial`: R_0 <- exp(w) R_0, t_0 <- t_0 + nu, Omega <- exp(R_parᵀ u)
    Omega.

    x (6,) is (w, nu), u (K+1, 3) without its row 0, dg (W,) the step of the global columns. R, t
    and D of the other parts are left to `place_parts`.
    """
    for i in range(tree.parents.shape[0]):
        if i == 0:
            E = exp3(x[0], x[1], x[2])
            old = pose.R[0]
            new = trial.R[0]
        else:
            R_parent_camera = transposed(entries(pose.R[tree.parents[i]]))
            E = exp3(*rotated(R_parent_camera, u[i]))
            old = pose.Omega[i]
            new = trial.Omega[i]
        write_entries(product(E, entries(old)), new)
    for r in range(3):
        trial.t[0, r] = pose.t[0, r] + x[3 + r]
    for a in range(tree.shape_count):
        trial.beta[a] = pose.beta[a] + dg[a]
    trial.log_focal[0] = pose.log_focal[0]
    if tree.global_count > tree.shape_count:
        trial.log_focal[0] += dg[tree.shape_count]
