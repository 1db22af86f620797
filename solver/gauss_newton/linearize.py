# SPDX-License-Identifier: GPL-3.0-or-later
"""One pass over the body: poses of the parts, cost, and the Gauss-Newton blocks of every term.

The 2D keypoint, 3D keypoint and orientation terms of one point are merged: with e = R_i v the lever
of the point from its part's origin, W = GᵀG of the position terms, W_d of the direction, f and f_d
the gradients,
    M += [[ [e]x (W + W_d) [e]xᵀ, [e]x W ], [., W]],   N += [ e x (W + W_d) V' ; W V' ],
    C += V'ᵀ (W + W_d) V'
with V' = R_i V. The derivative D of the part's origin by shape is added once per part, and the
part's sums, taken about its own origin, are then shifted to the pelvis, the origin of all twists.
Products that go into C are gathered as pairs of rows and multiplied many at a time. The arithmetic
of one point is in point_terms.py, of one part in part_sums.py; both are expanded here before LLVM
sees them.
"""

from typing import Any

import numpy as np

from ..compiled.kernel import expanded_kernel, kernel
from ..compiled.part import GRADIENT, SHAPE, Array, Blocks, Pose
from ..compiled.rows import add3 as add_rows
from ..compiled.rows import clear
from ..compiled.tree import Tree
from ..custom_residuals.external import accumulate_external
from ..residuals import shape_prior
from ..residuals.registry import (
    KEYPOINT2D,
    KEYPOINT3D,
    ORIENTATION_FIELD,
    SHAPE_PRIOR,
    accumulate_tables,
)
from .gram import add_gram
from .part_sums import (
    add3,
    add6,
    add9,
    add_cross,
    cross_both,
    rotate,
    shift_angular,
    shift_corner,
    write_part,
)
from .point_terms import point_at_rest, point_terms
from .row_pass import row_pass
from .terms import HAS_2D, HAS_SHAPE, Terms

QUEUE = 48  # pairs of rows (X, Z) of C += XᵀZ that are gathered before they are multiplied


def make_scratch(tree: Tree) -> Array:
    """Return the working memory of `linearize`: a queue of pairs of rows, each row X followed by
    its Z.
    """
    return np.zeros((2 * QUEUE, tree.S.shape[2]))


def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _place_formula(s, D_parent, S, D):  # type: ignore[no-untyped-def]
    """D = D_par + R_par S."""
    return [], [], [D_parent[r] + _dot(s[3 * r : 3 * r + 3], S) for r in range(3)]


def _point_formula(s, N, V, pairs):  # type: ignore[no-untyped-def]
    """V' = R V;  N += [[e]x W_all; W] V';  pairs (V', W_all V'). s: R (9), [e]x W_all (9), W (6),
    W_all (6).
    """
    moved = [_dot(s[3 * r : 3 * r + 3], V) for r in range(3)]
    W, W_all = (
        [[a[0], a[1], a[2]], [a[1], a[3], a[4]], [a[2], a[4], a[5]]] for a in (s[18:24], s[24:30])
    )
    angular = [N[r] + _dot(s[9 + 3 * r : 12 + 3 * r], moved) for r in range(3)]
    linear = [N[3 + r] + _dot(W[r], moved) for r in range(3)]
    weighted = [_dot(W_all[r], moved) for r in range(3)]
    return angular + linear, [], [row for pair in zip(moved, weighted, strict=True) for row in pair]


def _part_formula(s, N, D, pairs):  # type: ignore[no-untyped-def]
    """Add the origin's motion D to N and shift it to the pelvis. s: A (6), Z (9), the origin s (3),
    one half.

    With H = N_lin + A D / 2:  C += HᵀD + DᵀH,  N_ang += [s]x N_lin + Z D,  N_lin += A D.
    """
    a = s[:6]
    Z = s[6:15]
    (x, y, z) = s[15:18]
    half = s[18]
    AD = [_dot(row, D) for row in ([a[0], a[1], a[2]], [a[1], a[3], a[4]], [a[2], a[4], a[5]])]
    H = [N[3 + r] + AD[r] * half for r in range(3)]
    turned = [y * N[5] - z * N[4], z * N[3] - x * N[5], x * N[4] - y * N[3]]
    angular = [N[r] + turned[r] + _dot(Z[3 * r : 3 * r + 3], D) for r in range(3)]
    pairs = [row for r in range(3) for row in (H[r], D[r])] + [
        row for r in range(3) for row in (D[r], H[r])
    ]
    return angular + [N[3 + r] + AD[r] for r in range(3)], [], pairs


_place = row_pass(_place_formula, (3, 3, 0))
_point = row_pass(_point_formula, (6, 3, 0))
_part = row_pass(_part_formula, (6, 3, 0))


def make_pose(tree: Tree) -> Pose:
    """Return a pose of zeros and identities for `tree`."""
    n = len(tree.parents)
    w = tree.S.shape[2]
    eye = np.tile(np.eye(3), (n, 1, 1))
    return Pose(eye, eye.copy(), np.zeros((n, 3)), np.zeros((n, 3, w)), np.zeros(w), np.zeros(1))


def make_blocks(tree: Tree) -> Blocks:
    """Return blocks of zeros for `tree`."""
    n = len(tree.parents)
    w = tree.S.shape[2]
    return Blocks(
        np.zeros((n, 6, SHAPE + w)),
        np.zeros((n, 3, SHAPE + w)),
        np.zeros((n, 3, 3)),
        np.zeros((w, w)),
        np.zeros(w),
        np.zeros(1, np.int64),
    )


@kernel
def place_parts(tree: Tree, pose: Pose) -> None:
    """Fill R, t and D of parts 1..K from Omega, beta and the root's R and t; D_0 = 0."""
    W = tree.S.shape[2]
    R = pose.R
    t = pose.t
    D = pose.D
    beta = pose.beta
    for i in range(1, tree.parents.shape[0]):
        j = tree.parents[i]
        Q = R[j]
        Om = pose.Omega[i]
        x = tree.l[i, 0]
        y = tree.l[i, 1]
        z = tree.l[i, 2]
        for a in range(tree.shape):
            b = beta[a]
            x += tree.S[i, 0, a] * b
            y += tree.S[i, 1, a] * b
            z += tree.S[i, 2, a] * b
        turn = (Q[0, 0], Q[0, 1], Q[0, 2], Q[1, 0], Q[1, 1], Q[1, 2], Q[2, 0], Q[2, 1], Q[2, 2])
        _place(turn, W, D, 3 * j * W, W, tree.S, 3 * i * W, W, D, 3 * i * W, W)
        for r in range(3):
            q0 = Q[r, 0]
            q1 = Q[r, 1]
            q2 = Q[r, 2]
            for c in range(3):
                R[i, r, c] = q0 * Om[0, c] + q1 * Om[1, c] + q2 * Om[2, c]
            t[i, r] = t[j, r] + q0 * x + q1 * y + q2 * z


@kernel
def clear_blocks(blocks: Blocks) -> None:
    """Set everything but A to zero."""
    n = blocks.H_u.shape[0]
    W = blocks.c.shape[0]
    if blocks.cross[0]:
        clear(blocks.H_u, 0, 3 * n * (SHAPE + W))
        blocks.cross[0] = 0
    for i in range(n):
        for r in range(3):
            blocks.H_u[i, r, GRADIENT] = 0.0
            for k in range(3):
                blocks.H_uu[i, r, k] = 0.0
    clear(blocks.C, 0, W * W)
    clear(blocks.c, 0, W)


@expanded_kernel
def _make_room(C, W, scratch, waiting, more):  # type: ignore[no-untyped-def]
    """Multiply the queue out if it cannot take `more` pairs; return how many are waiting."""
    if waiting + more > QUEUE:
        add_gram(C, W, scratch, 0, 2 * W, scratch, W, 2 * W, waiting)
        waiting = 0
    return waiting


@expanded_kernel
def _add_points(tree, terms, i, t, settings, pose, blocks, scratch, waiting, cost):  # type: ignore[no-untyped-def]
    """Add the terms of part i's points to the cost, N, C and c.

    settings: weight and 1/sigma of each kind of term, focal scale, share of the second-order terms.
    Return the cost, how many pairs are waiting, and sums over the points about the part's origin: W
    (6), [e]x W (9), [e]x W_all [e]xᵀ (6), the force (3) and its moment (3), and those of the focal
    length's column.
    """
    A = blocks.A
    C = blocks.C
    c = blocks.c
    V = terms.V
    W = C.shape[0]
    P = tree.shape
    row = SHAPE + W
    fit_focal = tree.globals > P
    R = pose.R[i]
    r = (R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2])
    a00 = 0.0
    a01 = 0.0
    a02 = 0.0
    a11 = 0.0
    a12 = 0.0
    a22 = 0.0
    x00 = 0.0
    x01 = 0.0
    x02 = 0.0
    x10 = 0.0
    x11 = 0.0
    x12 = 0.0
    x20 = 0.0
    x21 = 0.0
    x22 = 0.0
    y00 = 0.0
    y01 = 0.0
    y02 = 0.0
    y11 = 0.0
    y12 = 0.0
    y22 = 0.0
    fx = 0.0
    fy = 0.0
    fz = 0.0
    mx = 0.0
    my = 0.0
    mz = 0.0
    # scalars, as in point_terms.py
    hx = 0.0
    hy = 0.0
    hz = 0.0
    nx = 0.0
    ny = 0.0
    nz = 0.0
    for j in range(terms.starts[i], terms.starts[i + 1]):
        flags = terms.flags[j]
        if flags <= HAS_SHAPE:
            continue
        e = rotate(r, point_at_rest(terms, pose.beta, j, P))
        cost, w, b, f, w_all, b_all, g, h, ff, fr = point_terms(terms, j, e, t, settings, cost)
        if fit_focal and flags & HAS_2D:
            C[P, P] += ff
            c[P] += fr
            hx, hy, hz = add3((hx, hy, hz), h)
            nx, ny, nz = add_cross((nx, ny, nz), e, h)
        a00, a01, a02, a11, a12, a22 = add6((a00, a01, a02, a11, a12, a22), w)
        x00, x01, x02, x10, x11, x12, x20, x21, x22 = add9(
            (x00, x01, x02, x10, x11, x12, x20, x21, x22), b
        )
        fx, fy, fz = add3((fx, fy, fz), f)
        y00, y01, y02, y11, y12, y22 = add6((y00, y01, y02, y11, y12, y22), cross_both(e, b_all))
        mx, my, mz = add_cross((mx, my, mz), e, g)
        if flags & HAS_SHAPE:
            waiting = _make_room(C, W, scratch, waiting, 3)
            at = 2 * waiting * W
            _point(
                r + b_all + w + w_all,
                W,
                A,
                6 * i * row + SHAPE,
                row,
                V,
                3 * j * W,
                W,
                scratch,
                at,
                W,
            )
            add_rows(c, 0, g[0], g[1], g[2], scratch, at, at + 2 * W, at + 4 * W, W)
            if fit_focal and flags & HAS_2D:
                k = 2 * waiting
                for n in range(P):
                    C[n, P] += (
                        scratch[k, n] * h[0] + scratch[k + 2, n] * h[1] + scratch[k + 4, n] * h[2]
                    )
            waiting += 3
    a = (a00, a01, a02, a11, a12, a22)
    x = (x00, x01, x02, x10, x11, x12, x20, x21, x22)
    y = (y00, y01, y02, y11, y12, y22)
    f = (fx, fy, fz)
    m = (mx, my, mz)
    return cost, waiting, (a, x, y, f, m, (hx, hy, hz), (nx, ny, nz))


@expanded_kernel
def _add_part(tree, i, s, sums, pose, blocks, scratch, waiting):  # type: ignore[no-untyped-def]
    """Shift part i's sums from its origin to the pelvis and write its block; return how many pairs
    are waiting.
    """
    a, x, y, f, m, h, n = sums
    A = blocks.A
    C = blocks.C
    c = blocks.c
    D = pose.D
    W = C.shape[0]
    P = tree.shape
    B = A[i]
    row = SHAPE + W
    at = 3 * i * W
    if tree.globals > P:
        B[0, SHAPE + P], B[1, SHAPE + P], B[2, SHAPE + P] = n
        B[3, SHAPE + P], B[4, SHAPE + P], B[5, SHAPE + P] = h
    z = shift_corner(s, x, a)
    if i > 0 and W > 0:
        waiting = _make_room(C, W, scratch, waiting, 6)
        _part(
            a + z + s + (0.5,),
            W,
            A,
            6 * i * row + SHAPE,
            row,
            D,
            at,
            W,
            scratch,
            2 * waiting * W,
            W,
        )
        waiting += 6
        add_rows(c, 0, f[0], f[1], f[2], D, at, at + W, at + 2 * W, W)
    write_part(B, shift_angular(s, y, x, z), z, a, s, f, m)
    return waiting


@kernel
def linearize(
    tree: Tree,
    terms: Terms,
    stage: Array,
    triggs: float,
    pose: Pose,
    blocks: Blocks,
    scratch: Array,
) -> float:
    """Place the parts, write the blocks at `pose`, and return the cost.

    stage (2, weights) is a row of weights and a row of 1/sigma, in the registry's order; scratch of
    `make_scratch`.
    """
    place_parts(tree, pose)
    weights = stage[0]
    inv_sigma = stage[1]
    settings = (
        weights[KEYPOINT2D], inv_sigma[KEYPOINT2D], weights[KEYPOINT3D], inv_sigma[KEYPOINT3D],
        weights[ORIENTATION_FIELD], inv_sigma[ORIENTATION_FIELD], np.exp(pose.log_focal[0]), triggs,
    )  # fmt: skip
    A = blocks.A
    C = blocks.C
    W = blocks.C.shape[0]
    clear_blocks(blocks)
    waiting = 0  # pairs in the queue
    ox = pose.t[0, 0]
    oy = pose.t[0, 1]
    oz = pose.t[0, 2]
    cost: float = 0.0
    for i in range(tree.parents.shape[0]):
        clear(A, 6 * i * (SHAPE + W), 6 * (SHAPE + W))
        if terms.starts[i] == terms.starts[i + 1]:
            continue
        tx = pose.t[i, 0]
        ty = pose.t[i, 1]
        tz = pose.t[i, 2]
        cost, waiting, sums = _add_points(
            tree, terms, i, (tx, ty, tz), settings, pose, blocks, scratch, waiting, cost
        )
        waiting = _add_part(
            tree, i, (tx - ox, ty - oy, tz - oz), sums, pose, blocks, scratch, waiting
        )
    add_gram(C, W, scratch, 0, 2 * W, scratch, W, 2 * W, waiting)
    cost += accumulate_tables(
        tree, terms.ints, terms.floats, weights, inv_sigma, triggs, pose, blocks
    )
    cost += accumulate_external(tree, terms.external, weights, inv_sigma, triggs, pose, blocks)
    cost += shape_prior.accumulate(
        terms.shape_mean, terms.shape_information, weights[SHAPE_PRIOR], pose, blocks
    )
    return cost
