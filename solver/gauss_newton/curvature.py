# SPDX-License-Identifier: Apache-2.0
"""What Gauss-Newton leaves out of a joint's Hessian, estimated from the steps that are taken.

The joint priors and limits together are functions f_i(Omega_i) of three numbers each. Gauss-Newton
takes JᵀJ for the Hessian of f_i and leaves out sum_k r_k d^2 r_k, which for the learned prior is as
large: steps along some joints are twice too long, along others half as long as they should be. A
symmetric rank-one update a joint, in the parent's axes,
    S <- S + d dᵀ / (dᵀw),   d = g(trial) - g(current) - (H + S) w,   w = R_parᵀ u
finds the missing part S from the gradients g that every trial computes anyway, within a few steps,
as only 3 x 3 numbers are unknown. H is JᵀJ at the trial if that was accepted, and at the current
pose if it was rejected. The step is solved with H + t S, the largest t of 1, 1/2, 1/4, 1/8 and 0
that keeps H + t S above a fifth of H. Source: partitioned quasi-Newton updates (Griewank and Toint,
Numerische Mathematik 39, 1982) on the part that Gauss-Newton omits (Dennis, Gay and Welsch, ACM
TOMS 7, 1981).
"""

from typing import NamedTuple

import numpy as np

from ..kernel import kernel
from ..part import GRADIENT, Array, Blocks, Pose
from ..rotations import turn_back
from ..tree import Tree

MIN_SHARE = 0.2  # of JᵀJ that H + t S keeps
MIN_COSINE = 0.1  # between d and w: below, dᵀw is uncertain and the update would be large
SHORTEST_STEP = 1e-7  # radians: below, the difference of two gradients is mostly rounding


class Curvature(NamedTuple):
    """The estimate for every joint at the current pose, in its parent's axes; row 0 is unused."""

    S: Array  # (K+1, 3, 3), estimate of what Gauss-Newton leaves out
    H: Array  # (K+1, 3, 3), JᵀJ
    g: Array  # (K+1, 3), gradient


def make_curvature(tree: Tree) -> Curvature:
    """Return a curvature of zeros for `tree`."""
    n = len(tree.parents)
    return Curvature(np.zeros((n, 3, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3)))


@kernel
def turned(R, H, transposed):  # type: ignore[no-untyped-def]
    """Return RᵀHR, or RHRᵀ if `transposed`, by rows of its upper triangle; H is symmetric."""
    a = R[0, 0]
    b = R[1, 0]
    c = R[2, 0]
    d = R[0, 1]
    e = R[1, 1]
    f = R[2, 1]
    g = R[0, 2]
    h = R[1, 2]
    k = R[2, 2]
    if transposed:
        b, c, d, f, g, h = d, g, b, h, c, f
    h00, h01, h02, h11, h12, h22 = H
    x0 = a * h00 + b * h01 + c * h02
    x1 = a * h01 + b * h11 + c * h12
    x2 = a * h02 + b * h12 + c * h22
    y0 = d * h00 + e * h01 + f * h02
    y1 = d * h01 + e * h11 + f * h12
    y2 = d * h02 + e * h12 + f * h22
    z0 = g * h00 + h * h01 + k * h02
    z1 = g * h01 + h * h11 + k * h12
    z2 = g * h02 + h * h12 + k * h22
    return (
        x0 * a + x1 * b + x2 * c, x0 * d + x1 * e + x2 * f, x0 * g + x1 * h + x2 * k,
        y0 * d + y1 * e + y2 * f, y0 * g + y1 * h + y2 * k, z0 * g + z1 * h + z2 * k,
    )  # fmt: skip


@kernel
def upper(M):  # type: ignore[no-untyped-def]
    """Return the upper triangle of M by rows."""
    return M[0, 0], M[0, 1], M[0, 2], M[1, 1], M[1, 2], M[2, 2]


@kernel
def _store(M, m):  # type: ignore[no-untyped-def]
    M[0, 0], M[0, 1], M[0, 2], M[1, 1], M[1, 2], M[2, 2] = m
    M[1, 0] = m[1]
    M[2, 0] = m[2]
    M[2, 1] = m[4]


@kernel
def _positive(h00, h01, h02, h11, h12, h22):  # type: ignore[no-untyped-def]
    """Whether a symmetric matrix is positive definite; False for NaN."""
    minor = h00 * h11 - h01 * h01
    det = h22 * minor - h00 * h12 * h12 + 2.0 * h01 * h02 * h12 - h11 * h02 * h02
    return h00 > 0.0 and minor > 0.0 and det > 0.0


@kernel
def allowed_share(H, S) -> float:  # type: ignore[no-untyped-def]
    """Return t: how much of S may be added to H."""
    h00, h01, h02, h11, h12, h22 = upper(H)
    s00, s01, s02, s11, s12, s22 = upper(S)
    k = 1.0 - MIN_SHARE
    t = 1.0
    for _ in range(4):
        if _positive(
            k * h00 + t * s00, k * h01 + t * s01, k * h02 + t * s02,
            k * h11 + t * s11, k * h12 + t * s12, k * h22 + t * s22,
        ):  # fmt: skip
            return t
        t *= 0.5
    return 0.0


@kernel
def reset(curvature: Curvature) -> None:
    """Set S to zero, as when the weights change."""
    curvature.S[:] = 0.0


@kernel
def set_current(tree: Tree, pose: Pose, blocks: Blocks, curvature: Curvature) -> None:
    """Make `pose`, with its blocks as `linearize` left them, the current one."""
    for i in range(1, tree.parents.shape[0]):
        R = pose.R[tree.parents[i]]
        _store(curvature.H[i], turned(R, upper(blocks.H_uu[i]), False))
        x = blocks.H_u[i, 0, GRADIENT]
        y = blocks.H_u[i, 1, GRADIENT]
        z = blocks.H_u[i, 2, GRADIENT]
        g = curvature.g[i]
        g[0], g[1], g[2] = turn_back(R, x, y, z)


@kernel
def update(
    tree: Tree,
    pose: Pose,
    u: Array,
    trial: Pose,
    trial_blocks: Blocks,
    accepted: bool,
    curvature: Curvature,
) -> None:
    """Update S by the step u (K+1, 3), in camera axes, from the current `pose` to `trial`.

    Residuals that couple a joint's state with its part's pose (blocks.cross) have gradients that
    depend on more than the joint: S stays as it is.
    """
    if trial_blocks.cross[0]:
        return
    for i in range(1, tree.parents.shape[0]):
        R = pose.R[tree.parents[i]]
        Q = trial.R[tree.parents[i]]
        w0, w1, w2 = turn_back(R, u[i, 0], u[i, 1], u[i, 2])
        length = w0 * w0 + w1 * w1 + w2 * w2
        if not length > SHORTEST_STEP * SHORTEST_STEP:
            continue
        x = trial_blocks.H_u[i, 0, GRADIENT]
        y = trial_blocks.H_u[i, 1, GRADIENT]
        z = trial_blocks.H_u[i, 2, GRADIENT]
        h = turned(Q, upper(trial_blocks.H_uu[i]), False) if accepted else upper(curvature.H[i])
        S = curvature.S[i]
        g = curvature.g[i]
        m00 = h[0] + S[0, 0]
        m01 = h[1] + S[0, 1]
        m02 = h[2] + S[0, 2]
        m11 = h[3] + S[1, 1]
        m12 = h[4] + S[1, 2]
        m22 = h[5] + S[2, 2]
        g0, g1, g2 = turn_back(Q, x, y, z)
        d0 = g0 - g[0] - m00 * w0 - m01 * w1 - m02 * w2
        d1 = g1 - g[1] - m01 * w0 - m11 * w1 - m12 * w2
        d2 = g2 - g[2] - m02 * w0 - m12 * w1 - m22 * w2
        along = d0 * w0 + d1 * w1 + d2 * w2
        if along * along > MIN_COSINE * MIN_COSINE * length * (d0 * d0 + d1 * d1 + d2 * d2):
            k = 1.0 / along
            _store(
                S,
                (
                    S[0, 0] + k * d0 * d0, S[0, 1] + k * d0 * d1, S[0, 2] + k * d0 * d2,
                    S[1, 1] + k * d1 * d1, S[1, 2] + k * d1 * d2, S[2, 2] + k * d2 * d2,
                ),
            )  # fmt: skip


@kernel
def apply_correction(
    tree: Tree, pose: Pose, blocks: Blocks, curvature: Curvature, share: float
) -> None:
    """Write R_par (H + share t S) R_parᵀ to the blocks of the current pose; a share of 0 restores
    Gauss-Newton's.
    """
    for i in range(1, tree.parents.shape[0]):
        H = curvature.H[i]
        S = curvature.S[i]
        h00, h01, h02, h11, h12, h22 = upper(H)
        t = share * allowed_share(H, S) if share > 0.0 else 0.0
        if t > 0.0:  # False if S has overflowed
            h00 = h00 + t * S[0, 0]
            h01 = h01 + t * S[0, 1]
            h02 = h02 + t * S[0, 2]
            h11 = h11 + t * S[1, 1]
            h12 = h12 + t * S[1, 2]
            h22 = h22 + t * S[2, 2]
        _store(
            blocks.H_uu[i], turned(pose.R[tree.parents[i]], (h00, h01, h02, h11, h12, h22), True)
        )
