# SPDX-License-Identifier: GPL-3.0-or-later
r"""Marginal covariances of a clip's joints and of its global columns, by selected inversion of the factor.

With the covariance S of the two frames that were eliminated after frame f, and of the global columns, and X their
columns of L^-1 [E_1 | E_2 | N],
    P = -L^-ᵀ X,    cov(f, later) = P S,    cov(f, f) = L^-ᵀ L^-1 + P S Pᵀ
so the diagonal blocks follow in one pass in opposite order, with nothing wider than 2 n + P. A joint's position is
linear in these unknowns: t_i = t_0 + sum over its parents, dt_i = J_i d_f + D_i dbeta.
The scale is that of the weights, which are inverse variances.
Source: the recursion for the entries of a sparse inverse by Takahashi, Fagan and Chin (1973).
"""

import numpy as np

from ..compiled.part import Array, Pose
from ..compiled.tree import Tree
from ..gauss_newton.optimizer import DAMPING_LEAST
from .band import Factor, eliminate_clip
from .system import GLOBALS, ClipSystem


def joint_covariances(
    tree: Tree, system: ClipSystem, poses: Pose, root_scale: float, factor: Factor
) -> tuple[Array, Array]:
    """Return the covariances (T, K+1, 3, 3) of the joints' positions, metres^2, and (G, G) of the global columns.

    :param system: linearized at `poses`; `factor` is overwritten.
    """
    eliminate_clip(system, DAMPING_LEAST, root_scale, factor)
    T, n, q = system.N.shape
    G = tree.globals
    C = np.triu(factor.C[:G, :G])
    of_globals = np.linalg.pinv(C + np.triu(C, 1).T, hermitian=True)
    middle = max(T // 2 - 1, 0)
    out = np.empty((T, len(tree.parents), 3, 3))
    start = np.zeros((2 * n + G, 2 * n + G))
    start[2 * n :, 2 * n :] = of_globals
    for f in range(min(middle + 1, T - 1), middle - 1, -1):
        start = _next(tree, poses, factor.Z[f], start, f, out)
    front = start
    back = np.empty_like(start)  # seen from the back, the first of the two is the later
    order = np.r_[n : 2 * n, :n, 2 * n : 2 * n + G]
    back[:] = start[np.ix_(order, order)]
    for f in range(middle - 1, -1, -1):
        front = _next(tree, poses, factor.Z[f], front, f, out)
    for f in range(middle + 2, T):
        back = _next(tree, poses, factor.Z[f], back, f, out)
    return out, of_globals


def _next(tree: Tree, poses: Pose, Z: Array, later: Array, f: int, out: Array) -> Array:
    """Write frame f's covariances and return that of frame f, the first of `later`, and the global columns."""
    n, G = Z.shape[0], tree.globals
    used = 3 + 3 * len(tree.parents)
    U = np.triu(Z[:used, :used], 1)
    diagonal = np.diagonal(Z)[:used]
    known = diagonal > 0.0
    # L^-ᵀ = U^-1, of which the diagonal is stored inverted; an unknown without a pivot does not move
    U[np.arange(used), np.arange(used)] = 1.0 / np.where(known, diagonal, 1.0)
    inverse = np.zeros((n, n))
    inverse[:used, :used] = np.linalg.inv(U) * known
    X = np.concatenate([Z[:, n : 3 * n], Z[:, 3 * n + GLOBALS : 3 * n + GLOBALS + G]], axis=1)
    P = -inverse @ X
    PS = P @ later
    own = inverse @ inverse.T + PS @ P.T
    own = 0.5 * (own + own.T)  # what is not symmetric of rounding would double from frame to frame
    out[f] = _of_joints(tree, poses, f, own, PS[:, 2 * n :], later[2 * n :, 2 * n :])
    following = np.zeros_like(later)
    keep = np.r_[:n, 2 * n : 2 * n + G]  # of `later`: the frame that follows, and the globals
    into = np.r_[n : 2 * n, 2 * n : 2 * n + G]
    following[:n, :n] = own
    following[:n, into] = PS[:, keep]
    following[into, :n] = PS[:, keep].T
    following[np.ix_(into, into)] = later[np.ix_(keep, keep)]
    return following


def _of_joints(tree: Tree, poses: Pose, f: int, own: Array, cross: Array, shared: Array) -> Array:
    """Return the covariances (K+1, 3, 3) of the joints' positions."""
    K1, P, n = len(tree.parents), tree.shape, len(own)
    t = poses.t[f]
    J = np.zeros((K1, 3, n))
    J[:, :, 3:6] = np.eye(3)
    for i in range(1, K1):
        k = int(tree.parents[i])
        while k >= 0:
            first = 0 if k == 0 else 3 + 3 * k
            e = t[i] - t[k]
            J[i, :, first : first + 3] = [[0.0, e[2], -e[1]], [-e[2], 0.0, e[0]], [e[1], -e[0], 0.0]]
            k = int(tree.parents[k])
    D = poses.D[f][:, :, :P]
    mixed = J @ cross[:, :P] @ D.transpose(0, 2, 1)
    covariance: Array = J @ own @ J.transpose(0, 2, 1) + mixed + mixed.transpose(0, 2, 1)
    covariance += D @ shared[:P, :P] @ D.transpose(0, 2, 1)
    return covariance
