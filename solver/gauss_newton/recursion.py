# SPDX-License-Identifier: GPL-3.0-or-later
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

from ..compiled.kernel import expanded_kernel, kernel
from ..compiled.part import GRADIENT, SHAPE, Array, Blocks, Pose
from ..compiled.rows import add1, add3, copy
from ..compiled.tree import Tree
from ..rotations import exp3
from .gram import subtract_gram
from .linearize import make_scratch
from .row_pass import row_pass

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


def _moment_formula(s, A, Y, _):  # type: ignore[no-untyped-def]
    """Y = UᵀA: the moment about the joint, A_ang - s x A_lin. s: the joint's origin."""
    x, y, z = s
    turned = [y * A[5] - z * A[4], z * A[3] - x * A[5], x * A[4] - y * A[3]]
    return [], [A[r] - turned[r] for r in range(3)], []


def _scale_formula(s, Y, _, __):  # type: ignore[no-untyped-def]
    """Y~ = L^-1 Y. s: L^-1 by rows of its lower triangle."""
    return [Y[0] * s[0], Y[0] * s[1] + Y[1] * s[2], Y[0] * s[3] + Y[1] * s[4] + Y[2] * s[5]], [], []


def _parent_formula(s, A_parent, A, Y):  # type: ignore[no-untyped-def]
    """A_par += A - Y~ᵀY~. s: the first six columns of Y~ (18)."""
    out = []
    for r in range(6):
        out.append(A_parent[r] + A[r] - Y[0] * s[3 * r] - Y[1] * s[3 * r + 1] - Y[2] * s[3 * r + 2])
    return out, [], []


_moment = row_pass(_moment_formula, (6, 0, 0))
_scale = row_pass(_scale_formula, (3, 0, 0))
_to_parent = row_pass(_parent_formula, (6, 6, 3))


@kernel
def factorize(H, row: int, n: int, diagonal) -> None:  # type: ignore[no-untyped-def]
    """Replace [H | rest], rows of length `row` whose first n columns are symmetric, by L^-1 [H |
    rest], H = L Lᵀ.

    Only the upper triangle is read, and L_ii^-1 is put on the diagonal. A pivot that is not
    positive to rounding gets 0 for its inverse, so that its unknown becomes 0. diagonal (n,) is
    overwritten.
    """
    for j in range(n):
        diagonal[j] = H[j, j]
    for j in range(n):
        d = H[j, j]
        inverse = 1.0 / math.sqrt(d) if d > TINY * abs(diagonal[j]) and d > 1e-290 else 0.0
        square = -inverse * inverse
        for i in range(j + 1, n):
            first = i & ~3
            add1(H, i * row + first, H[j, i] * square, H, j * row + first, row - first)
        for k in range(row):
            H[j, k] *= inverse
        H[j, j] = inverse


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
    A = work.A
    Y = work.Y
    L = work.L
    C = work.C
    c = work.c
    W = c.shape[0]
    row = SHAPE + W
    n = tree.parents.shape[0]
    P = tree.globals
    copy(A, 0, blocks.A, 0, 6 * n * row)
    copy(c, 0, blocks.c, 0, W)
    copy(C, 0, blocks.C, 0, W * W)
    ox = pose.t[0, 0]
    oy = pose.t[0, 1]
    oz = pose.t[0, 2]
    squares = 0.0
    for i in range(n - 1, 0, -1):
        sx = pose.t[i, 0] - ox
        sy = pose.t[i, 1] - oy
        sz = pose.t[i, 2] - oz
        base = 6 * i * row
        y = 3 * i * row
        _moment((sx, sy, sz), row, A, base, row, Y, y, row, Y, y, row)
        if blocks.cross[0]:
            add1(Y, y, 1.0, blocks.H_u, y, 3 * row)
        else:
            for r in range(3):
                Y[i, r, GRADIENT] += blocks.H_u[i, r, GRADIENT]
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
        F = L[i]
        F[0] = i00
        F[1] = i10
        F[2] = i11
        F[3] = i20
        F[4] = i21
        F[5] = i22
        _scale((i00, i10, i11, i20, i21, i22), row, Y, y, row, Y, y, row, Y, y, row)
        g0 = T[0, GRADIENT]
        g1 = T[1, GRADIENT]
        g2 = T[2, GRADIENT]
        squares += g0 * g0 + g1 * g1 + g2 * g2
        to = 6 * tree.parents[i] * row
        columns = (
            T[0, 0], T[1, 0], T[2, 0], T[0, 1], T[1, 1], T[2, 1], T[0, 2], T[1, 2], T[2, 2],
            T[0, 3], T[1, 3], T[2, 3], T[0, 4], T[1, 4], T[2, 4], T[0, 5], T[1, 5], T[2, 5],
        )  # fmt: skip
        _to_parent(columns, row, A, to, row, A, base, row, Y, y, row)
        e = y + SHAPE
        add3(c, 0, -g0, -g1, -g2, Y, e, e + row, e + 2 * row, W)
    if W > 0:
        subtract_gram(C, W, Y, 3 * row + SHAPE, row, 3 * (n - 1))
    root = work.root
    copy(root, 0, A, 0, 6 * row)
    for r in range(6):
        root[r, r] += damping if r < 3 else damping * root_scale * root_scale
    factorize(root, row, 6, work.x[0])
    for r in range(6):
        g = root[r, GRADIENT]
        squares += g * g
        add1(c, 0, -g, root, r * row + SHAPE, W)
    if W > 0:
        subtract_gram(C, W, root, SHAPE, row, 6)
    for a in range(P):
        for b in range(a):
            C[a, b] = C[b, a]
    return squares


@kernel
def solve_globals(tree: Tree, C, c, dbeta) -> float:  # type: ignore[no-untyped-def]
    """Solve C dbeta = -c for the global columns, overwriting C with its factor; return |L^-1
    c|^2.
    """
    P = tree.globals
    W = C.shape[0]
    factorize(C, W, P, dbeta)
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
    P = tree.globals
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
            R = pose.R[tree.parents[i]]
            E = exp3(
                R[0, 0] * u[i, 0] + R[1, 0] * u[i, 1] + R[2, 0] * u[i, 2],
                R[0, 1] * u[i, 0] + R[1, 1] * u[i, 1] + R[2, 1] * u[i, 2],
                R[0, 2] * u[i, 0] + R[1, 2] * u[i, 1] + R[2, 2] * u[i, 2],
            )
            old = pose.Omega[i]
            new = trial.Omega[i]
        for k in range(3):
            a = old[0, k]
            b = old[1, k]
            d = old[2, k]
            new[0, k] = E[0] * a + E[1] * b + E[2] * d
            new[1, k] = E[3] * a + E[4] * b + E[5] * d
            new[2, k] = E[6] * a + E[7] * b + E[8] * d
    for r in range(3):
        trial.t[0, r] = pose.t[0, r] + x[3 + r]
    for a in range(tree.shape):
        trial.beta[a] = pose.beta[a] + dg[a]
    trial.log_focal[0] = pose.log_focal[0]
    if tree.globals > tree.shape:
        trial.log_focal[0] += dg[tree.shape]
