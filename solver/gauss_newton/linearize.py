# SPDX-License-Identifier: Apache-2.0
"""One pass over the body: poses of the parts, cost, and the Gauss-Newton blocks of every term.

The 2D keypoint, 3D keypoint and orientation terms of one point are merged: with e = R_i v the lever
of the point from its part's origin, W = GᵀG of the position terms, W_d of the direction, f and f_d
the gradients,
    M += [[ [e]x (W + W_d) [e]xᵀ, [e]x W ], [., W]],   N += [ e x (W + W_d) V' ; W V' ],
    C += V'ᵀ (W + W_d) V'
with V' = R_i V. The derivative D of the part's origin by shape is added once per part, and the
part's sums, taken about its own origin, are then shifted to the pelvis, the origin of all twists.

In the order in which they are called from the end of this file: `linearize`, `place_parts`, and for
each part `_add_points` with `_point_terms` for each of its points, then `_add_part`. Vectors are
tuples of 3 numbers, 3 x 3 matrices of 9 by rows, symmetric ones of the 6 of their upper triangle by
rows; the loops over the shape's columns are in plain_rows.py.
"""

import numpy as np

from ..kernel import expanded_kernel, kernel
from ..matrices import entries
from ..part import GRADIENT, SHAPE, Array, Blocks, Pose
from ..residuals import keypoint2d, keypoint3d, orientation_field, shape_prior
from ..residuals.external import accumulate_external
from ..residuals.registry import (
    KEYPOINT2D,
    KEYPOINT3D,
    ORIENTATION_FIELD,
    SHAPE_PRIOR,
    accumulate_tables,
)
from ..tree import Tree
from .rows import add_origin, add_point, place_origin
from .terms import HAS_2D, HAS_3D, HAS_DIRECTION, HAS_SHAPE, Terms

# Of each entry of a symmetric matrix, its number in the upper triangle by rows.
_UPPER = ((0, 1, 2), (1, 3, 4), (2, 4, 5))
_ZERO3 = (0.0, 0.0, 0.0)
_ZERO6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_ZERO9 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def make_scratch(tree: Tree) -> Array:
    """Return the working memory of `linearize`: the rows (12, W) of one point or part."""
    return np.zeros((12, tree.S.shape[2]))


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
    R = pose.R
    t = pose.t
    for i in range(1, tree.parents.shape[0]):
        j = tree.parents[i]
        Q = R[j]
        Om = pose.Omega[i]
        x = tree.l[i, 0]
        y = tree.l[i, 1]
        z = tree.l[i, 2]
        for a in range(tree.shape):
            b = pose.beta[a]
            x += tree.S[i, 0, a] * b
            y += tree.S[i, 1, a] * b
            z += tree.S[i, 2, a] * b
        place_origin(pose.D[j], entries(Q), tree.S[i], pose.D[i])
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
    if blocks.cross[0]:
        blocks.H_u[:] = 0.0
        blocks.cross[0] = 0
    for i in range(blocks.H_u.shape[0]):
        for r in range(3):
            blocks.H_u[i, r, GRADIENT] = 0.0
            for k in range(3):
                blocks.H_uu[i, r, k] = 0.0
    blocks.C[:] = 0.0
    blocks.c[:] = 0.0


@expanded_kernel
def _add3(a, b):  # type: ignore[no-untyped-def]
    """Return a + b, three numbers each."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@expanded_kernel
def _add6(a, b):  # type: ignore[no-untyped-def]
    """Return a + b, six numbers each."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@expanded_kernel
def _add9(a, b):  # type: ignore[no-untyped-def]
    """Return a + b, nine numbers each."""
    return (
        a[0] + b[0],
        a[1] + b[1],
        a[2] + b[2],
        a[3] + b[3],
        a[4] + b[4],
        a[5] + b[5],
        a[6] + b[6],
        a[7] + b[7],
        a[8] + b[8],
    )


@expanded_kernel
def _rotate(r, v):  # type: ignore[no-untyped-def]
    """Return R v; r: R by rows (9), v (3)."""
    x, y, z = v
    return (
        r[0] * x + r[1] * y + r[2] * z,
        r[3] * x + r[4] * y + r[5] * z,
        r[6] * x + r[7] * y + r[8] * z,
    )


@expanded_kernel
def _add_cross(m, a, b):  # type: ignore[no-untyped-def]
    """Return m + a x b."""
    return (
        m[0] + a[1] * b[2] - a[2] * b[1],
        m[1] + a[2] * b[0] - a[0] * b[2],
        m[2] + a[0] * b[1] - a[1] * b[0],
    )


@expanded_kernel
def _cross_symmetric(a, w):  # type: ignore[no-untyped-def]
    """Return [a]x W by rows (9); w: the upper triangle of a symmetric W by rows (6)."""
    x, y, z = a
    w00, w01, w02, w11, w12, w22 = w
    return (
        y * w02 - z * w01, y * w12 - z * w11, y * w22 - z * w12,
        z * w00 - x * w02, z * w01 - x * w12, z * w02 - x * w22,
        x * w01 - y * w00, x * w11 - y * w01, x * w12 - y * w02,
    )  # fmt: skip


@expanded_kernel
def _cross_both(a, b):  # type: ignore[no-untyped-def]
    """Return the upper triangle by rows (6) of [a]x W [a]xᵀ; b: [a]x W by rows (9)."""
    x, y, z = a
    return (
        y * b[2] - z * b[1], z * b[0] - x * b[2], x * b[1] - y * b[0],
        z * b[3] - x * b[5], x * b[4] - y * b[3], x * b[7] - y * b[6],
    )  # fmt: skip


@expanded_kernel
def _shift_corner(s, x, a):  # type: ignore[no-untyped-def]
    """Return Z = X + [s]x A, the corner of M about the pelvis; s: the part's origin from there."""
    sx, sy, sz = s
    a00, a01, a02, a11, a12, a22 = a
    return (
        x[0] + sy * a02 - sz * a01, x[1] + sy * a12 - sz * a11, x[2] + sy * a22 - sz * a12,
        x[3] + sz * a00 - sx * a02, x[4] + sz * a01 - sx * a12, x[5] + sz * a02 - sx * a22,
        x[6] + sx * a01 - sy * a00, x[7] + sx * a11 - sy * a01, x[8] + sx * a12 - sy * a02,
    )  # fmt: skip


@expanded_kernel
def _shift_angular(s, y, x, z):  # type: ignore[no-untyped-def]
    """Return Y + X [s]xᵀ + [s]x Zᵀ, the angular block of M about the pelvis: its upper triangle by
    rows (6).
    """
    sx, sy, sz = s
    y00, y01, y02, y11, y12, y22 = y
    y00 += sy * x[2] - sz * x[1] + sy * z[2] - sz * z[1]
    y01 += sz * x[0] - sx * x[2] + sy * z[5] - sz * z[4]
    y02 += sx * x[1] - sy * x[0] + sy * z[8] - sz * z[7]
    y11 += sz * x[3] - sx * x[5] + sz * z[3] - sx * z[5]
    y12 += sx * x[4] - sy * x[3] + sz * z[6] - sx * z[8]
    y22 += sx * x[7] - sy * x[6] + sx * z[7] - sy * z[6]
    return y00, y01, y02, y11, y12, y22


@expanded_kernel
def _write_part(B, y, z, a, s, f, m):  # type: ignore[no-untyped-def]
    """Write M = [[Y, Z], [Zᵀ, A]], the force f and its moment m + s x f to a part's block B (6,
    8+W).
    """
    for r in range(3):
        for k in range(3):
            B[r, k] = y[_UPPER[r][k]]
            B[r, 3 + k] = z[3 * r + k]
            B[3 + k, r] = z[3 * r + k]
            B[3 + r, 3 + k] = a[_UPPER[r][k]]
    B[0, GRADIENT], B[1, GRADIENT], B[2, GRADIENT] = _add_cross(m, s, f)
    B[3, GRADIENT], B[4, GRADIENT], B[5, GRADIENT] = f


@expanded_kernel
def point_at_rest(terms, beta, j, P):  # type: ignore[no-untyped-def]
    """Return V_j beta + v_bar_j of slot j, in its part's axes."""
    x = terms.rest[j, 0]
    y = terms.rest[j, 1]
    z = terms.rest[j, 2]
    if terms.flags[j] & HAS_SHAPE:
        for a in range(P):
            b = beta[a]
            x += terms.V[j, 0, a] * b
            y += terms.V[j, 1, a] * b
            z += terms.V[j, 2, a] * b
    return x, y, z


@expanded_kernel
def _point_terms(terms, j, e, t, settings, cost):  # type: ignore[no-untyped-def]
    """Evaluate what was measured of slot j, at e (3) from the origin t (3) of its part.

    settings: weight and 1/sigma of each kind of term, focal scale.
    Return the cost so far; W = GᵀG (6), [e]x W (9) and Gᵀr (3) of the position terms; with the
    direction, W, [e]x W and Gᵀr of all; and Gᵀg (3), gᵀg and gᵀr of the focal length, g = dr/dlog
    f.
    """
    w2, k2, w3, k3, wd, kd, focal = settings
    flags = terms.flags[j]
    p = _add3(e, t)
    w = _ZERO6
    f = _ZERO3
    h = _ZERO3
    ff = 0.0
    fr = 0.0
    if flags & HAS_2D:
        q = terms.image[j]
        more, w, f, h, ff, fr = keypoint2d.term(p, (q[0], q[1]), focal, w2 * q[2], k2)
        cost += more
    if flags & HAS_3D:
        q = terms.point[j]
        more, w_more, f_more = keypoint3d.term(p, (q[0], q[1], q[2]), w3 * q[3], k3)
        cost += more
        w = _add6(w, w_more)
        f = _add3(f, f_more)
    b = _cross_symmetric(e, w)
    w_all = w
    b_all = b
    f_all = f
    if flags & HAS_DIRECTION:
        q = terms.direction[j]
        more, w_more, f_more = orientation_field.term(e, (q[0], q[1], q[2]), wd * q[3], kd)
        cost += more
        w_all = _add6(w, w_more)
        f_all = _add3(f, f_more)
        b_all = _cross_symmetric(e, w_all)
    return cost, w, b, f, w_all, b_all, f_all, h, ff, fr


@expanded_kernel
def _add_points(  # type: ignore[no-untyped-def]
    tree, terms, i, t, settings, pose, blocks, scratch, cost
):
    """Add the terms of part i's points to the cost, N, C and c.

    settings: weight and 1/sigma of each kind of term, focal scale.
    Return the cost and sums over the points about the part's origin: W (6), [e]x W (9), [e]x W_all
    [e]xᵀ (6), the force (3) and its moment (3), and those of the focal length's column.
    """
    C = blocks.C
    c = blocks.c
    P = tree.shape
    fit_focal = tree.globals > P
    r = entries(pose.R[i])
    a = _ZERO6
    x = _ZERO9
    y = _ZERO6
    force = _ZERO3
    moment = _ZERO3
    focal_force = _ZERO3
    focal_moment = _ZERO3
    for j in range(terms.starts[i], terms.starts[i + 1]):
        flags = terms.flags[j]
        if flags <= HAS_SHAPE:
            continue
        e = _rotate(r, point_at_rest(terms, pose.beta, j, P))
        cost, w, b, f, w_all, b_all, f_all, h, ff, fr = _point_terms(terms, j, e, t, settings, cost)
        if fit_focal and flags & HAS_2D:
            C[P, P] += ff
            c[P] += fr
            focal_force = _add3(focal_force, h)
            focal_moment = _add_cross(focal_moment, e, h)
        a = _add6(a, w)
        x = _add9(x, b)
        y = _add6(y, _cross_both(e, b_all))
        force = _add3(force, f)
        moment = _add_cross(moment, e, f_all)
        if flags & HAS_SHAPE:
            add_point(terms.V[j], r, w, w_all, b_all, f_all, blocks.A[i], C, c, scratch)
            if fit_focal and flags & HAS_2D:
                for n in range(P):
                    C[n, P] += scratch[0, n] * h[0] + scratch[1, n] * h[1] + scratch[2, n] * h[2]
    return cost, (a, x, y, force, moment, focal_force, focal_moment)


@expanded_kernel
def _add_part(tree, i, s, sums, pose, blocks, scratch):  # type: ignore[no-untyped-def]
    """Shift part i's sums from its origin to the pelvis and write its block."""
    a, x, y, f, m, h, n = sums
    B = blocks.A[i]
    P = tree.shape
    if tree.globals > P:
        B[0, SHAPE + P], B[1, SHAPE + P], B[2, SHAPE + P] = n
        B[3, SHAPE + P], B[4, SHAPE + P], B[5, SHAPE + P] = h
    z = _shift_corner(s, x, a)
    if i > 0 and tree.S.shape[2] > 0:
        add_origin(pose.D[i], a, z, s, f, B, blocks.C, blocks.c, scratch)
    _write_part(B, _shift_angular(s, y, x, z), z, a, s, f, m)


@kernel
def linearize(
    tree: Tree,
    terms: Terms,
    stage: Array,
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
        weights[ORIENTATION_FIELD], inv_sigma[ORIENTATION_FIELD], np.exp(pose.log_focal[0]),
    )  # fmt: skip
    clear_blocks(blocks)
    ox = pose.t[0, 0]
    oy = pose.t[0, 1]
    oz = pose.t[0, 2]
    cost: float = 0.0
    for i in range(tree.parents.shape[0]):
        B = blocks.A[i]
        for r in range(6):
            for k in range(B.shape[1]):
                B[r, k] = 0.0
        if terms.starts[i] == terms.starts[i + 1]:
            continue
        tx = pose.t[i, 0]
        ty = pose.t[i, 1]
        tz = pose.t[i, 2]
        cost, sums = _add_points(
            tree, terms, i, (tx, ty, tz), settings, pose, blocks, scratch, cost
        )
        _add_part(tree, i, (tx - ox, ty - oy, tz - oz), sums, pose, blocks, scratch)
    cost += accumulate_tables(tree, terms.ints, terms.floats, weights, pose, blocks)
    cost += accumulate_external(tree, terms.external, weights, pose, blocks)
    cost += shape_prior.accumulate(
        terms.shape_mean, terms.shape_information, weights[SHAPE_PRIOR], pose, blocks
    )
    return cost
