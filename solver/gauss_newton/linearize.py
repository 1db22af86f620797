# SPDX-License-Identifier: GPL-3.0-or-later
"""One pass over the body: poses of the parts, cost, and the Gauss-Newton blocks of every term.

The 2D keypoint, 3D keypoint and orientation terms of one point are merged: with e = R_i v the lever of the point from
its part's origin, W = GᵀG of the position terms, W_d of the direction, f and f_d the gradients,
    M += [[ [e]x (W + W_d) [e]xᵀ, [e]x W ], [., W]],   N += [ e x (W + W_d) V' ; W V' ],   C += V'ᵀ (W + W_d) V'
with V' = R_i V. The derivative D of the part's origin by shape is added once per part, and the part's sums, taken
about its own origin, are then shifted to the pelvis, the origin of all twists. Products that go into C are gathered as
pairs of rows and multiplied many at a time.
"""

from typing import Any

import numpy as np

from ..compiled.kernel import kernel
from ..compiled.part import GRADIENT, SHAPE, Array, Blocks, Pose
from ..compiled.rows import add3, clear
from ..compiled.tree import Tree
from ..custom_residuals.external import accumulate_external
from ..residuals import keypoint2d, keypoint3d, orientation_field, shape_prior
from ..residuals.registry import KEYPOINT2D, KEYPOINT3D, ORIENTATION_FIELD, SHAPE_PRIOR, accumulate_tables
from .gram import add_gram
from .row_pass import row_pass
from .terms import HAS_2D, HAS_3D, HAS_DIRECTION, HAS_SHAPE, Terms

QUEUE = 48  # pairs of rows (X, Z) of C += XᵀZ that are gathered before they are multiplied


def make_scratch(tree: Tree) -> Array:
    """Return the working memory of `linearize`: a queue of pairs of rows, each row X followed by its Z."""
    return np.zeros((2 * QUEUE, tree.S.shape[2]))


def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _place_formula(s, D_parent, S, D):  # type: ignore[no-untyped-def]
    """D = D_par + R_par S."""
    return [], [], [D_parent[r] + _dot(s[3 * r : 3 * r + 3], S) for r in range(3)]


def _point_formula(s, N, V, pairs):  # type: ignore[no-untyped-def]
    """V' = R V;  N += [[e]x W_all; W] V';  pairs (V', W_all V'). s: R (9), [e]x W_all (9), W (6), W_all (6)."""
    moved = [_dot(s[3 * r : 3 * r + 3], V) for r in range(3)]
    W, W_all = ([[a[0], a[1], a[2]], [a[1], a[3], a[4]], [a[2], a[4], a[5]]] for a in (s[18:24], s[24:30]))
    angular = [N[r] + _dot(s[9 + 3 * r : 12 + 3 * r], moved) for r in range(3)]
    linear = [N[3 + r] + _dot(W[r], moved) for r in range(3)]
    weighted = [_dot(W_all[r], moved) for r in range(3)]
    return angular + linear, [], [row for pair in zip(moved, weighted, strict=True) for row in pair]


def _part_formula(s, N, D, pairs):  # type: ignore[no-untyped-def]
    """Add the origin's motion D to N and shift it to the pelvis. s: A (6), Z (9), the origin s (3), one half.

    With H = N_lin + A D / 2:  C += HᵀD + DᵀH,  N_ang += [s]x N_lin + Z D,  N_lin += A D.
    """
    a, Z, (x, y, z), half = s[:6], s[6:15], s[15:18], s[18]
    AD = [_dot(row, D) for row in ([a[0], a[1], a[2]], [a[1], a[3], a[4]], [a[2], a[4], a[5]])]
    H = [N[3 + r] + AD[r] * half for r in range(3)]
    turned = [y * N[5] - z * N[4], z * N[3] - x * N[5], x * N[4] - y * N[3]]
    angular = [N[r] + turned[r] + _dot(Z[3 * r : 3 * r + 3], D) for r in range(3)]
    pairs = [row for r in range(3) for row in (H[r], D[r])] + [row for r in range(3) for row in (D[r], H[r])]
    return angular + [N[3 + r] + AD[r] for r in range(3)], [], pairs


_place = row_pass(_place_formula, (3, 3, 0))
_point, _part = row_pass(_point_formula, (6, 3, 0)), row_pass(_part_formula, (6, 3, 0))


def make_pose(tree: Tree) -> Pose:
    """Return a pose of zeros and identities for `tree`."""
    n, w = len(tree.parents), tree.S.shape[2]
    eye = np.tile(np.eye(3), (n, 1, 1))
    return Pose(eye, eye.copy(), np.zeros((n, 3)), np.zeros((n, 3, w)), np.zeros(w), np.zeros(1))


def make_blocks(tree: Tree) -> Blocks:
    """Return blocks of zeros for `tree`."""
    n, w = len(tree.parents), tree.S.shape[2]
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
    R, t, D, beta = pose.R, pose.t, pose.D, pose.beta
    for i in range(1, tree.parents.shape[0]):
        j = tree.parents[i]
        Q, Om = R[j], pose.Omega[i]
        x, y, z = tree.l[i, 0], tree.l[i, 1], tree.l[i, 2]
        for a in range(tree.shape):
            b = beta[a]
            x += tree.S[i, 0, a] * b
            y += tree.S[i, 1, a] * b
            z += tree.S[i, 2, a] * b
        turn = (Q[0, 0], Q[0, 1], Q[0, 2], Q[1, 0], Q[1, 1], Q[1, 2], Q[2, 0], Q[2, 1], Q[2, 2])
        _place(turn, W, D, 3 * j * W, W, tree.S, 3 * i * W, W, D, 3 * i * W, W)
        for r in range(3):
            q0, q1, q2 = Q[r, 0], Q[r, 1], Q[r, 2]
            for c in range(3):
                R[i, r, c] = q0 * Om[0, c] + q1 * Om[1, c] + q2 * Om[2, c]
            t[i, r] = t[j, r] + q0 * x + q1 * y + q2 * z


@kernel
def clear_blocks(blocks: Blocks) -> None:
    """Set everything but A to zero."""
    n, W = blocks.H_u.shape[0], blocks.c.shape[0]
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


@kernel
def linearize(
    tree: Tree, terms: Terms, stage: Array, triggs: float, pose: Pose, blocks: Blocks, scratch: Array
) -> float:
    """Place the parts, write the blocks at `pose`, and return the cost.

    stage (2, weights) is a row of weights and a row of 1/sigma, in the registry's order; scratch of `make_scratch`.
    """
    place_parts(tree, pose)
    weights, inv_sigma = stage[0], stage[1]
    w2, w3, wd = weights[KEYPOINT2D], weights[KEYPOINT3D], weights[ORIENTATION_FIELD]
    k2, k3, kd = inv_sigma[KEYPOINT2D], inv_sigma[KEYPOINT3D], inv_sigma[ORIENTATION_FIELD]
    A, C, c, D, V, rest = blocks.A, blocks.C, blocks.c, pose.D, terms.V, terms.rest
    W, P = C.shape[0], tree.shape
    row = SHAPE + W
    fit_focal = tree.globals > P
    focal = np.exp(pose.log_focal[0])
    clear_blocks(blocks)
    waiting = 0  # pairs in the queue
    ox, oy, oz = pose.t[0, 0], pose.t[0, 1], pose.t[0, 2]
    cost: float = 0.0
    for i in range(tree.parents.shape[0]):
        base = 6 * i * row
        clear(A, base, 6 * row)
        if terms.starts[i] == terms.starts[i + 1]:
            continue
        R = pose.R[i]
        r00, r01, r02, r10, r11, r12 = R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2]
        r20, r21, r22 = R[2, 0], R[2, 1], R[2, 2]
        tx, ty, tz = pose.t[i, 0], pose.t[i, 1], pose.t[i, 2]
        # sums over the part's points, about its origin: W, [e]x W, [e]x W_all [e]xT, and forces with their moments
        a00, a01, a02, a11, a12, a22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        x00, x01, x02, x10, x11, x12, x20, x21, x22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        y00, y01, y02, y11, y12, y22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        hx, hy, hz, nx, ny, nz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(terms.starts[i], terms.starts[i + 1]):
            flags = terms.flags[j]
            if flags <= HAS_SHAPE:
                continue
            vx, vy, vz = rest[j, 0], rest[j, 1], rest[j, 2]
            if flags & HAS_SHAPE:
                for a in range(P):
                    b = pose.beta[a]
                    vx += V[j, 0, a] * b
                    vy += V[j, 1, a] * b
                    vz += V[j, 2, a] * b
            ex = r00 * vx + r01 * vy + r02 * vz
            ey = r10 * vx + r11 * vy + r12 * vz
            ez = r20 * vx + r21 * vy + r22 * vz
            w00, w01, w02, w11, w12, w22, gx, gy, gz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            px, py, pz = 0.0, 0.0, 0.0
            if flags & HAS_2D:
                q = terms.image[j]
                e, w00, w01, w02, w11, w12, w22, gx, gy, gz, px, py, pz, ff, fr = keypoint2d.term(
                    ex + tx, ey + ty, ez + tz, q[0], q[1], focal, w2 * q[2], k2, triggs
                )
                cost += e
                if fit_focal:
                    C[P, P] += ff
                    c[P] += fr
                    hx, hy, hz = hx + px, hy + py, hz + pz
                    nx, ny, nz = nx + ey * pz - ez * py, ny + ez * px - ex * pz, nz + ex * py - ey * px
            if flags & HAS_3D:
                q = terms.point[j]
                e, w3d, k, ux, uy, uz = keypoint3d.term(
                    ex + tx, ey + ty, ez + tz, q[0], q[1], q[2], w3 * q[3], k3, triggs
                )
                cost += e
                gx, gy, gz = gx + ux, gy + uy, gz + uz
                w00, w01, w02 = w00 + w3d - k * ux * ux, w01 - k * ux * uy, w02 - k * ux * uz
                w11, w12, w22 = w11 + w3d - k * uy * uy, w12 - k * uy * uz, w22 + w3d - k * uz * uz
            # position terms: [e]x W, and the force
            b00, b01, b02 = ey * w02 - ez * w01, ey * w12 - ez * w11, ey * w22 - ez * w12
            b10, b11, b12 = ez * w00 - ex * w02, ez * w01 - ex * w12, ez * w02 - ex * w22
            b20, b21, b22 = ex * w01 - ey * w00, ex * w11 - ey * w01, ex * w12 - ey * w02
            a00, a01, a02, a11, a12, a22 = a00 + w00, a01 + w01, a02 + w02, a11 + w11, a12 + w12, a22 + w22
            x00, x01, x02 = x00 + b00, x01 + b01, x02 + b02
            x10, x11, x12 = x10 + b10, x11 + b11, x12 + b12
            x20, x21, x22 = x20 + b20, x21 + b21, x22 + b22
            fx, fy, fz = fx + gx, fy + gy, fz + gz
            p00, p01, p02, p11, p12, p22 = w00, w01, w02, w11, w12, w22
            if flags & HAS_DIRECTION:
                q = terms.direction[j]
                e, d00, d01, d02, d11, d12, d22, ux, uy, uz = orientation_field.term(
                    ex, ey, ez, q[0], q[1], q[2], wd * q[3], kd, triggs
                )
                cost += e
                gx, gy, gz = gx + ux, gy + uy, gz + uz
                w00, w01, w02, w11, w12, w22 = w00 + d00, w01 + d01, w02 + d02, w11 + d11, w12 + d12, w22 + d22
                b00, b01, b02 = ey * w02 - ez * w01, ey * w12 - ez * w11, ey * w22 - ez * w12
                b10, b11, b12 = ez * w00 - ex * w02, ez * w01 - ex * w12, ez * w02 - ex * w22
                b20, b21, b22 = ex * w01 - ey * w00, ex * w11 - ey * w01, ex * w12 - ey * w02
            y00 += ey * b02 - ez * b01
            y01 += ez * b00 - ex * b02
            y02 += ex * b01 - ey * b00
            y11 += ez * b10 - ex * b12
            y12 += ex * b11 - ey * b10
            y22 += ex * b21 - ey * b20
            mx, my, mz = mx + ey * gz - ez * gy, my + ez * gx - ex * gz, mz + ex * gy - ey * gx
            if flags & HAS_SHAPE:
                if waiting + 3 > QUEUE:
                    add_gram(C, W, scratch, 0, 2 * W, scratch, W, 2 * W, waiting)
                    waiting = 0
                at = 2 * waiting * W
                waiting += 3
                entries = (
                    r00, r01, r02, r10, r11, r12, r20, r21, r22, b00, b01, b02, b10, b11, b12, b20, b21, b22,
                    p00, p01, p02, p11, p12, p22, w00, w01, w02, w11, w12, w22,
                )  # fmt: skip
                _point(entries, W, A, base + SHAPE, row, V, 3 * j * W, W, scratch, at, W)
                add3(c, 0, gx, gy, gz, scratch, at, at + 2 * W, at + 4 * W, W)
                if fit_focal and flags & HAS_2D:
                    k = 2 * (waiting - 3)
                    for a in range(P):
                        C[a, P] += scratch[k, a] * px + scratch[k + 2, a] * py + scratch[k + 4, a] * pz
        B = A[i]
        if fit_focal:
            B[0, SHAPE + P], B[1, SHAPE + P], B[2, SHAPE + P] = nx, ny, nz
            B[3, SHAPE + P], B[4, SHAPE + P], B[5, SHAPE + P] = hx, hy, hz
        # shift to the pelvis: moments gain s x force, with s the part's origin from there
        sx, sy, sz = tx - ox, ty - oy, tz - oz
        # Z = X + [s]x A is the corner of M; M_aa = Y + X [s]xT + [s]x ZT
        z00, z01, z02 = x00 + sy * a02 - sz * a01, x01 + sy * a12 - sz * a11, x02 + sy * a22 - sz * a12
        z10, z11, z12 = x10 + sz * a00 - sx * a02, x11 + sz * a01 - sx * a12, x12 + sz * a02 - sx * a22
        z20, z21, z22 = x20 + sx * a01 - sy * a00, x21 + sx * a11 - sy * a01, x22 + sx * a12 - sy * a02
        if i > 0 and W > 0:
            if waiting + 6 > QUEUE:
                add_gram(C, W, scratch, 0, 2 * W, scratch, W, 2 * W, waiting)
                waiting = 0
            origin = (
                a00, a01, a02, a11, a12, a22, z00, z01, z02, z10, z11, z12, z20, z21, z22, sx, sy, sz, 0.5
            )  # fmt: skip
            _part(origin, W, A, base + SHAPE, row, D, 3 * i * W, W, scratch, 2 * waiting * W, W)
            waiting += 6
            add3(c, 0, fx, fy, fz, D, 3 * i * W, 3 * i * W + W, 3 * i * W + 2 * W, W)
        y00 += sy * x02 - sz * x01 + sy * z02 - sz * z01
        y01 += sz * x00 - sx * x02 + sy * z12 - sz * z11
        y02 += sx * x01 - sy * x00 + sy * z22 - sz * z21
        y11 += sz * x10 - sx * x12 + sz * z10 - sx * z12
        y12 += sx * x11 - sy * x10 + sz * z20 - sx * z22
        y22 += sx * x21 - sy * x20 + sx * z21 - sy * z20
        B[0, 0], B[0, 1], B[0, 2], B[0, 3], B[0, 4], B[0, 5] = y00, y01, y02, z00, z01, z02
        B[1, 0], B[1, 1], B[1, 2], B[1, 3], B[1, 4], B[1, 5] = y01, y11, y12, z10, z11, z12
        B[2, 0], B[2, 1], B[2, 2], B[2, 3], B[2, 4], B[2, 5] = y02, y12, y22, z20, z21, z22
        B[3, 0], B[3, 1], B[3, 2], B[3, 3], B[3, 4], B[3, 5] = z00, z10, z20, a00, a01, a02
        B[4, 0], B[4, 1], B[4, 2], B[4, 3], B[4, 4], B[4, 5] = z01, z11, z21, a01, a11, a12
        B[5, 0], B[5, 1], B[5, 2], B[5, 3], B[5, 4], B[5, 5] = z02, z12, z22, a02, a12, a22
        B[0, GRADIENT] = mx + sy * fz - sz * fy
        B[1, GRADIENT] = my + sz * fx - sx * fz
        B[2, GRADIENT] = mz + sx * fy - sy * fx
        B[3, GRADIENT], B[4, GRADIENT], B[5, GRADIENT] = fx, fy, fz
    add_gram(C, W, scratch, 0, 2 * W, scratch, W, 2 * W, waiting)
    cost += accumulate_tables(tree, terms.ints, terms.floats, weights, inv_sigma, triggs, pose, blocks)
    cost += accumulate_external(tree, terms.external, weights, inv_sigma, triggs, pose, blocks)
    cost += shape_prior.accumulate(terms.shape_mean, terms.shape_information, weights[SHAPE_PRIOR], pose, blocks)
    return cost
