# SPDX-License-Identifier: Apache-2.0
r"""Marginal covariances of a clip's joints and of its global columns, by selected inversion of the
factor.

With L_f Z_f the rows of frame f, X = -L_f^-T Z_f without its first block says how the frame's
unknowns follow from those that are eliminated after it: of the two frames after it, and the global
columns. With S the covariance of all these,
    cov(f, later) = X S,   cov(f, f) = L_f^-T L_f^-1 + X S X^T
so the diagonal blocks follow in one pass in opposite order, with nothing wider than 3 n + W. A
joint's position is linear in these unknowns: dt_i = J_i (d_f, dbeta). The scale is that of the
weights, which are inverse variances. Source: the recursion for the entries of a sparse inverse by
Takahashi, Fagan and Chin (1973), by blocks.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from ..fitting.normal_equations import motion_of_joints
from ..gauss_newton.optimizer import MIN_DAMPING
from ..part import Array, Pose
from ..tree import Tree
from .band import Factor, eliminate_clip, middle_of, run_both
from .system import GLOBALS, ClipSystem, pose_of


class ClipCovariance(NamedTuple):
    """Covariances of T frames and of what they share."""

    joints: Array  # (T, K+1, 3, 3) of the joints' positions, metres^2
    from_root: Array  # (T, K+1, 3, 3) of their positions relative to part 0
    shared: Array  # (G, G) of the global columns


def joint_covariances(
    tree: Tree,
    system: ClipSystem,
    poses: Pose,
    root_scale: float,
    factor: Factor,
    pool: ThreadPoolExecutor | None = None,
) -> ClipCovariance:
    """Return the covariances of the joints' positions and of the global columns.

    :param system: linearized at `poses`; `factor` is overwritten.
    :param pool: a thread of it takes the second half.
    """
    eliminate_clip(system, MIN_DAMPING, root_scale, factor, pool)
    T, n, _ = system.N.shape
    G = tree.global_count
    parts = len(tree.parents)
    shared = _shared_covariance(factor.C[:G, :G])
    out = ClipCovariance(np.empty((T, parts, 3, 3)), np.empty((T, parts, 3, 3)), shared)
    middle = middle_of(T)
    end = middle + min(T, 2)
    nothing = np.zeros((2 * n + len(factor.c),) * 2)
    nothing[2 * n : 2 * n + G, 2 * n : 2 * n + G] = shared
    later = _select(tree, poses, factor.Z, range(end - 1, middle - 1, -1), nothing, out)
    # seen from the back, the first of the two frames is the later one
    order = np.r_[n : 2 * n, :n, 2 * n : len(later)]
    front = tree, poses, factor.Z, range(middle - 1, -1, -1), later, out
    back = tree, poses, factor.Z, range(end, T), later[np.ix_(order, order)], out
    run_both(pool, _select, front, back)
    return out


def _shared_covariance(information: Array) -> Array:
    """Return the covariance (G, G) of the global columns.

    What nothing fixes, as a column of the shape without measurements and prior, varies as an
    unknown of the poses does: as if by the least damping alone.

    :param information: (G, G), of which the upper triangle is read.
    """
    upper = np.triu(information)
    values, vectors = np.linalg.eigh(upper + np.triu(upper, 1).T)
    covariance: Array = vectors / np.maximum(values, MIN_DAMPING) @ vectors.T
    return covariance


def _select(
    tree: Tree, poses: Pose, Z: Array, frames: range, later: Array, out: ClipCovariance
) -> Array:
    """Write the covariances of frames, each eliminated before the last one.

    An unknown without a pivot, of which Z holds the inverse 0, is fixed by nothing but a damping
    that was lost in rounding: it varies as if by that alone.

    :param Z: of the clip's `Factor`.
    :param later: (2 n + W, 2 n + W) covariance of the two frames that were eliminated after the
        first of `frames`, the nearer one first, and of the global columns.
    :return: the same for the frame that follows.
    """
    n = Z.shape[1]
    unknowns = 3 + 3 * len(tree.parents)
    rows = np.r_[:unknowns, 3 * n : 3 * n + tree.shape_count]
    kept = np.r_[: 2 * n, 3 * n : len(later) + n]
    for f in frames:
        inverse_pivots = np.diagonal(Z[f])
        is_free = inverse_pivots == 0.0
        others = np.where(is_free[:, None], 0.0, Z[f])
        pivots = 1.0 / np.where(is_free, MIN_DAMPING**-0.5, inverse_pivots)
        inverse = np.linalg.inv(np.triu(others[:, :n], 1) + np.diag(pivots))
        X = -inverse @ np.delete(others[:, n:], np.s_[2 * n : 2 * n + GLOBALS], axis=1)
        cross = X @ later
        own = inverse @ inverse.T + cross @ X.T
        own = 0.5 * (own + own.T)  # otherwise, rounding errors grow from frame to frame
        S = np.block([[own, cross], [cross.T, later]])
        later = S[np.ix_(kept, kept)]
        J = motion_of_joints(tree, pose_of(poses, f))
        of_frame = S[np.ix_(rows, rows)]
        out.joints[f] = _projected(of_frame, J)
        out.from_root[f] = _projected(of_frame, J - J[0])
    return later


def _projected(S: Array, J: Array) -> Array:
    """Return J S Jᵀ (K+1, 3, 3) of J (K+1, 3, n), by one large product instead of many small."""
    JS = (J.reshape(-1, len(S)) @ S).reshape(J.shape)
    projected: Array = JS @ J.transpose(0, 2, 1)
    return projected
