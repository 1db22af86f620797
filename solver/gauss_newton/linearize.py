# SPDX-License-Identifier: Apache-2.0
"""One pass over the body: poses of the parts, cost, and the Gauss-Newton blocks of every term.

The 2D keypoint, 3D keypoint and orientation terms of one point are merged: with e = R_i v the lever
of the point from its part's origin, W = GᵀG of the position terms, W_d of the direction, f and f_d
the gradients,
    M += [[ [e']x W [e']xᵀ + [e]x W_d [e]xᵀ, [e']x W ], [., W]],
    N += [ e' x W V' + e x W_d V' ; W V' ],   C += V'ᵀ (W + W_d) V'
with V' = R_i V, and e' = e + t_i - o from the pelvis, about which all twists are. The derivative D
of the part's origin by shape is added once per part.

In the order in which they are called from the end of this file: `linearize`, `place_parts`, and for
each part `_add_points` with `_point_terms` for each of its points, then `add_block` and
`add_origin`. Vectors and matrices are tuples as in matrices.py; the loops over the shape's columns
are in plain_rows.py.
"""

from typing import NamedTuple

import numpy as np

from ..kernel import expanded_kernel, kernel
from ..matrices import (
    add3,
    add6,
    add9,
    add_cross,
    cross_both,
    cross_symmetric,
    entries,
    product,
    rotated,
    write_entries,
)
from ..part import GRADIENT, SHAPE, Array, Blocks, Pose
from ..residuals import keypoint2d, keypoint3d, orientation_field, shape_prior
from ..residuals.accumulation import add_block, shaped
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

_ZERO3 = (0.0, 0.0, 0.0)
_ZERO6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_ZERO9 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def make_scratch(tree: Tree) -> Array:
    """Return the working memory of `linearize`: the rows (6, W) of one point or part."""
    return np.zeros((6, tree.S.shape[2]))


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
        Q = entries(R[j])
        x, y, z = shaped(tree.l, tree.S, pose.beta, i, tree.shape_count)
        place_origin(pose.D[j], Q, tree.S[i], pose.D[i])
        write_entries(product(Q, entries(pose.Omega[i])), R[i])
        for r in range(3):
            t[i, r] = t[j, r] + Q[3 * r] * x + Q[3 * r + 1] * y + Q[3 * r + 2] * z


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


class Strengths(NamedTuple):
    """Weight and 1/sigma of each kind of measurement in a stage, and the focal scale."""

    image: tuple[float, float]
    space: tuple[float, float]
    direction: tuple[float, float]
    focal: float


class PointTerms(NamedTuple):
    """What the terms of one slot add up to, with W and e' as above and E = [e']x."""

    W: tuple[float, ...]  # (6), of the position terms
    EW: tuple[float, ...]  # (9)
    W_all: tuple[float, ...]  # (6), W + W_d
    EW_all: tuple[float, ...]  # (9), EW + [e]x W_d
    EWE: tuple[float, ...]  # (6), EWEᵀ + [e]x W_d [e]xᵀ
    force: tuple[float, ...]  # (3), f
    force_all: tuple[float, ...]  # (3), f + f_d
    moment: tuple[float, ...]  # (3), about the pelvis
    focal_force: tuple[float, ...]  # (3), Gᵀg, with g = dr/dlog f of the focal length
    focal_square: float  # gᵀg
    focal_gradient: float  # gᵀr


@expanded_kernel
def _point_terms(terms, j, e, s, t, strengths, cost):  # type: ignore[no-untyped-def]
    """Return the cost so far, with what was measured of slot j, and its `PointTerms`; the point is
    at e (3) from its part's origin, which is at s (3) from the pelvis and at t (3) in the camera.
    """
    w2, k2 = strengths.image
    w3, k3 = strengths.space
    wd, kd = strengths.direction
    flags = terms.flags[j]
    p = add3(e, t)
    e_pelvis = add3(e, s)
    w = _ZERO6
    f = _ZERO3
    h = _ZERO3
    ff = 0.0
    fr = 0.0
    if flags & HAS_2D:
        q = terms.image[j]
        more, w, f, h, ff, fr = keypoint2d.term(p, (q[0], q[1]), strengths.focal, w2 * q[2], k2)
        cost += more
    if flags & HAS_3D:
        q = terms.point[j]
        more, w_more, f_more = keypoint3d.term(p, (q[0], q[1], q[2]), w3 * q[3], k3)
        cost += more
        w = add6(w, w_more)
        f = add3(f, f_more)
    b = cross_symmetric(e_pelvis, w)
    y = cross_both(e_pelvis, b)
    moment = add_cross(_ZERO3, e_pelvis, f)
    w_all = w
    b_all = b
    f_all = f
    if flags & HAS_DIRECTION:
        q = terms.direction[j]
        more, w_more, f_more = orientation_field.term(e, (q[0], q[1], q[2]), wd * q[3], kd)
        cost += more
        b_more = cross_symmetric(e, w_more)
        y = add6(y, cross_both(e, b_more))
        moment = add_cross(moment, e, f_more)
        w_all = add6(w, w_more)
        b_all = add9(b, b_more)
        f_all = add3(f, f_more)
    return cost, PointTerms(w, b, w_all, b_all, y, f, f_all, moment, h, ff, fr)


@expanded_kernel
def _add_points(  # type: ignore[no-untyped-def]
    tree, terms, i, s, t, strengths, pose, blocks, scratch, cost
):
    """Add the terms of part i's points to the cost, N, C and c.

    s, t: the part's origin from the pelvis and in the camera; strengths: `Strengths`.
    Return the cost and sums over the points about the pelvis: of [e']x W [e']xᵀ + [e]x W_d [e]xᵀ
    (6), [e']x W (9), W (6), the moment (3) and the force (3).
    """
    B = blocks.A[i]
    C = blocks.C
    c = blocks.c
    P = tree.shape_count
    fit_focal = tree.global_count > P
    r = entries(pose.R[i])
    w_sum = _ZERO6
    b_sum = _ZERO9
    y_sum = _ZERO6
    force = _ZERO3
    moment = _ZERO3
    for j in range(terms.starts[i], terms.starts[i + 1]):
        flags = terms.flags[j]
        if flags <= HAS_SHAPE:
            continue
        e = rotated(r, shaped(terms.rest, terms.V, pose.beta, j, P if flags & HAS_SHAPE else 0))
        cost, p = _point_terms(terms, j, e, s, t, strengths, cost)
        w_sum = add6(w_sum, p.W)
        b_sum = add9(b_sum, p.EW)
        y_sum = add6(y_sum, p.EWE)
        force = add3(force, p.force)
        moment = add3(moment, p.moment)
        if flags & HAS_SHAPE:
            add_point(terms.V[j], r, p.W, p.W_all, p.EW_all, p.force_all, B, C, c, scratch)
        if fit_focal and flags & HAS_2D:
            h = p.focal_force
            C[P, P] += p.focal_square
            c[P] += p.focal_gradient
            focal_moment = add_cross(_ZERO3, add3(e, s), h)
            for k in range(3):
                B[k, SHAPE + P] += focal_moment[k]
                B[3 + k, SHAPE + P] += h[k]
            if flags & HAS_SHAPE:
                for n in range(P):
                    C[n, P] += scratch[0, n] * h[0] + scratch[1, n] * h[1] + scratch[2, n] * h[2]
    return cost, y_sum, b_sum, w_sum, moment, force


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
    strengths = Strengths(
        (weights[KEYPOINT2D], inv_sigma[KEYPOINT2D]),
        (weights[KEYPOINT3D], inv_sigma[KEYPOINT3D]),
        (weights[ORIENTATION_FIELD], inv_sigma[ORIENTATION_FIELD]),
        np.exp(pose.log_focal[0]),
    )
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
        t = (pose.t[i, 0], pose.t[i, 1], pose.t[i, 2])
        s = (t[0] - ox, t[1] - oy, t[2] - oz)
        cost, y, z, w, m, f = _add_points(
            tree, terms, i, s, t, strengths, pose, blocks, scratch, cost
        )
        if i > 0 and tree.S.shape[2] > 0:
            add_origin(pose.D[i], w, z, f, B, blocks.C, blocks.c, scratch)
        add_block(B, y, z, w, m, f)
    cost += accumulate_tables(tree, terms.ints, terms.floats, weights, pose, blocks)
    cost += accumulate_external(tree, terms.external, weights, pose, blocks)
    cost += shape_prior.accumulate(
        terms.shape_mean, terms.shape_information, weights[SHAPE_PRIOR], pose, blocks
    )
    return cost
