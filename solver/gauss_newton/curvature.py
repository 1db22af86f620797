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
from ..matrices import add6, entries, formula, outer, rotated, symmetric, transposed, turned, upper
from ..part import GRADIENT, Array, Blocks, Pose
from ..tree import Tree

MIN_SHARE = 0.2  # of JᵀJ that H + t S keeps
MIN_COSINE = 0.1  # between d and w: below, dᵀw is uncertain and the update would be large
SHORTEST_STEP = 1e-7  # radians: below, the difference of two gradients is mostly rounding


class Curvature(NamedTuple):
    """The estimate for every joint at the current pose, in its parent's axes; row 0 is unused.
    Symmetric matrices by rows of their upper triangle.
    """

    S: Array  # (K+1, 6), estimate of what Gauss-Newton leaves out
    H: Array  # (K+1, 6), JᵀJ
    g: Array  # (K+1, 3), gradient


def make_curvature(tree: Tree) -> Curvature:
    """Return a curvature of zeros for `tree`."""
    n = len(tree.parents)
    return Curvature(np.zeros((n, 6)), np.zeros((n, 6)), np.zeros((n, 3)))


@kernel
def _is_positive(h):  # type: ignore[no-untyped-def]
    """Whether a symmetric matrix is positive definite; False for NaN."""
    h00, h01, h02, h11, h12, h22 = h
    minor = h00 * h11 - h01 * h01
    det = h22 * minor - h00 * h12 * h12 + 2.0 * h01 * h02 * h12 - h11 * h02 * h02
    return h00 > 0.0 and minor > 0.0 and det > 0.0


@formula
def _scaled(t, h):  # type: ignore[no-untyped-def]
    """Return t H, symmetric."""
    return t * h[0], t * h[1], t * h[2], t * h[3], t * h[4], t * h[5]


@kernel
def allowed_part(H, S, share):  # type: ignore[no-untyped-def]
    """Return share t S, symmetric: as much of S as may be added to H."""
    t = 1.0
    for _ in range(4):
        if _is_positive(add6(_scaled(1.0 - MIN_SHARE, H), _scaled(t, S))):
            return _scaled(share * t, S)
        t *= 0.5
    return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0  # as well if S has overflowed


@kernel
def reset(curvature: Curvature) -> None:
    """Set S to zero, as when the weights change."""
    curvature.S[:] = 0.0


@kernel
def _hessian_and_gradient(tree, pose, blocks, i):  # type: ignore[no-untyped-def]
    """Return JᵀJ, symmetric, and the gradient of joint i in its parent's axes."""
    R_parent_camera = transposed(entries(pose.R[tree.parents[i]]))
    g = blocks.H_u[i, :, GRADIENT]
    H = upper(entries(blocks.H_uu[i]))
    return turned(R_parent_camera, H), rotated(R_parent_camera, g)


@kernel
def set_current(tree: Tree, pose: Pose, blocks: Blocks, curvature: Curvature) -> None:
    """Make `pose`, with its blocks as `linearize` left them, the current one."""
    for i in range(1, tree.parents.shape[0]):
        H, g = _hessian_and_gradient(tree, pose, blocks, i)
        for k in range(6):
            curvature.H[i, k] = H[k]
        for k in range(3):
            curvature.g[i, k] = g[k]


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
        w0, w1, w2 = rotated(transposed(entries(pose.R[tree.parents[i]])), u[i])
        length = w0 * w0 + w1 * w1 + w2 * w2
        if not length > SHORTEST_STEP * SHORTEST_STEP:
            continue
        H, g_trial = _hessian_and_gradient(tree, trial, trial_blocks, i)
        S = curvature.S[i]
        g = curvature.g[i]
        if not accepted:
            H = _scaled(1.0, curvature.H[i])
        m0, m1, m2 = rotated(symmetric(add6(H, S)), (w0, w1, w2))
        d0 = g_trial[0] - g[0] - m0
        d1 = g_trial[1] - g[1] - m1
        d2 = g_trial[2] - g[2] - m2
        along = d0 * w0 + d1 * w1 + d2 * w2
        if along * along > MIN_COSINE * MIN_COSINE * length * (d0 * d0 + d1 * d1 + d2 * d2):
            more = outer(1.0 / along, d0, d1, d2)
            for k in range(6):
                S[k] += more[k]


@kernel
def apply_correction(
    tree: Tree, pose: Pose, blocks: Blocks, curvature: Curvature, share: float
) -> None:
    """Write R_par (H + share t S) R_parᵀ to the blocks of the current pose; a share of 0 restores
    Gauss-Newton's.
    """
    for i in range(1, tree.parents.shape[0]):
        H = curvature.H[i]
        R = entries(pose.R[tree.parents[i]])
        corrected = symmetric(turned(R, add6(H, allowed_part(H, curvature.S[i], share))))
        for r in range(3):
            for k in range(3):
                blocks.H_uu[i, r, k] = corrected[3 * r + k]
