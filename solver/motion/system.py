# SPDX-License-Identifier: Apache-2.0
r"""The normal equations of a clip: dense blocks of width 6 + 3K a frame, what couples them, and
global columns.

The unknowns of frame f are d_f = (w, nu, u_1..u_K), those of `recursion.py`: the root's twist about
the pelvis, then the joints' rotations, all in the axes that the poses are given in. Part i moves by
x_i = x_0 + sum of U_j u_j over the joints j on its way from the root, so that with M, N, m summed
over the parts that hang on joint i,
    Y_i = U_iᵀ M_i + H_ux,      H(u_i, x_0) = Y_i,      H(u_i, u_j) = Y_i U_j  for j above i
    H(u_i, u_i) = Y_i U_i + H_uu + (H_ux U_i)ᵀ
which is what the recursion factorizes without ever forming it. A clip needs it, because two frames
are coupled in all of their unknowns once one of them has been eliminated. Source: section 3 of the
paper; composite rigid bodies in Featherstone, Rigid Body Dynamics Algorithms, chapter 6.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from ..gauss_newton.recursion import copy_rows
from ..kernel import kernel
from ..matrices import entries, symmetric, transposed, turned, upper
from ..part import GRADIENT, SHAPE, Array, Blocks, Pose
from ..tree import Tree, padded

GLOBALS = 4  # first global column of `ClipSystem.N`; its column 0 is the gradient


class Contacts(NamedTuple):
    """How C standing points couple each frame f to the one before: block (f, f-1) -= w_f J_fᵀ
    J_{f-1} for each.
    """

    w: Array  # (T, C)
    p: Array  # (T, C, 3) the points
    J: Array  # (T, C, 3, m+W): their derivatives by m unknowns and then by the shape
    columns: Array  # (C, m) the unknowns that move each point, ascending
    counts: Array  # (C,) how many they are


class ClipSystem(NamedTuple):
    """JᵀJ and Jᵀr of a clip of T frames. n is 6 + 3K padded to whole vectors, W as in `Tree`."""

    D: Array  # (T, n, n): block (f, f), its upper triangle
    # (T, K+2, 3, 3): blocks of (f, f-1) between rotations of part 0..K, and between the root's
    # positions
    B1: Array
    B2: Array  # (T, K+2, 3, 3): the same of (f, f-2)
    N: Array  # (T, n, 4+W): gradient, three unused, global columns
    C: Array  # (W, W): upper triangle
    c: Array  # (W,)
    contacts: Contacts  # the rest of (f, f-1)


def make_system(tree: Tree, frames: int, points: Sequence[int] | Array = ()) -> ClipSystem:
    """Return a system of zeros for that many frames, in which the points of these numbers (C,) may
    stand.
    """
    K = len(tree.parents) - 1
    W = tree.S.shape[2]
    n = padded(6 + 3 * K)
    shapes: list[tuple[int, ...]] = [(n, n), (K + 2, 3, 3), (K + 2, 3, 3), (n, GLOBALS + W)]
    D, B1, B2, N = (np.zeros((frames, *shape)) for shape in shapes)
    columns = [_columns(tree, int(tree.point_part[j])) for j in points]
    counts = np.array([len(some) for some in columns], np.int64)
    m = max(counts, default=0)
    C = len(points)
    padded_columns = np.array([some + [0] * (m - len(some)) for some in columns], np.int64).reshape(
        C, m
    )
    J = np.zeros((frames, C, 3, m + W))
    contacts = Contacts(np.zeros((frames, C)), np.zeros((frames, C, 3)), J, padded_columns, counts)
    return ClipSystem(D, B1, B2, N, np.zeros((W, W)), np.zeros(W), contacts)


def _columns(tree: Tree, part: int) -> list[int]:
    """Return the unknowns that move a part, ascending."""
    found: list[int] = []
    while part > 0:
        found = [3 + 3 * part, 4 + 3 * part, 5 + 3 * part, *found]
        part = int(tree.parents[part])
    return [*range(6), *found]


def make_poses(tree: Tree, frames: int) -> Pose:
    """Return the poses of a clip in arrays with a leading dimension of frames; beta and log_focal
    as of one frame.
    """
    K = len(tree.parents) - 1
    W = tree.S.shape[2]
    eye = np.tile(np.eye(3), (frames, K + 1, 1, 1))
    t = np.zeros((frames, K + 1, 3))
    D = np.zeros((frames, K + 1, 3, W))
    return Pose(eye, eye.copy(), t, D, np.zeros(W), np.zeros(1))


@register_jitable
def pose_of(poses: Pose, f: int) -> Pose:
    """Return views of frame f's arrays; for kernels as well."""
    return Pose(poses.Omega[f], poses.R[f], poses.t[f], poses.D[f], poses.beta, poses.log_focal)


@kernel
def add_turned(turn, source: Blocks, sums: Blocks) -> None:  # type: ignore[no-untyped-def]
    """Add blocks of a camera whose axes are turn (3, 3) times those of `sums`: x' = (R w, R nu), u'
    = R u.
    """
    n = source.A.shape[0]
    row = source.A.shape[2]
    W = source.c.shape[0]
    for i in range(n):
        for half in range(3):
            # rows of A (two halves) and of H_u are turned alike
            rows = source.H_u[i] if half == 2 else source.A[i, 3 * half : 3 * half + 3]
            into = sums.H_u[i] if half == 2 else sums.A[i, 3 * half : 3 * half + 3]
            for r in range(3):
                a = turn[0, r]
                b = turn[1, r]
                c = turn[2, r]
                for k in range(GRADIENT, row):
                    into[r, k] += a * rows[0, k] + b * rows[1, k] + c * rows[2, k]
                for first in range(0, 6, 3):
                    x = a * rows[0, first] + b * rows[1, first] + c * rows[2, first]
                    y = a * rows[0, first + 1] + b * rows[1, first + 1] + c * rows[2, first + 1]
                    z = a * rows[0, first + 2] + b * rows[1, first + 2] + c * rows[2, first + 2]
                    for s in range(3):
                        into[r, first + s] += x * turn[0, s] + y * turn[1, s] + z * turn[2, s]
        H = symmetric(turned(transposed(entries(turn)), upper(entries(source.H_uu[i]))))
        for r in range(3):
            for s in range(3):
                sums.H_uu[i, r, s] += H[3 * r + s]
    for a in range(W):
        sums.c[a] += source.c[a]
        for b in range(W):
            sums.C[a, b] += source.C[a, b]
    if source.cross[0]:
        sums.cross[0] = 1


@kernel
def write_frame(  # type: ignore[no-untyped-def]
    tree: Tree, pose: Pose, blocks: Blocks, sums, D, N, C, c
) -> None:
    """Write a frame's block (n, n), upper triangle, and its gradient and global columns (n, 4+W);
    add to C and c.

    sums (K+1, 6, 8+W) is overwritten.
    """
    n_parts = blocks.A.shape[0]
    row = blocks.A.shape[2]
    W = blocks.c.shape[0]
    o = pose.t[0]
    for a in range(D.shape[0]):
        for b in range(a - a % 3, D.shape[0]):
            D[a, b] = 0.0
    N[:] = 0.0
    for i in range(n_parts):
        copy_rows(blocks.A[i], sums[i])
    for i in range(n_parts - 1, 0, -1):
        S = sums[i]
        up = sums[tree.parents[i]]
        H = blocks.H_uu[i]
        Y = blocks.H_u[i]
        x = pose.t[i, 0] - o[0]
        y = pose.t[i, 1] - o[1]
        z = pose.t[i, 2] - o[2]
        for r in range(6):
            for k in range(row):
                up[r, k] += S[r, k]
        # rows 0..2 of S become Y = UᵀS + H_u: the moment about the joint
        for k in range(row):
            f0 = S[3, k]
            f1 = S[4, k]
            f2 = S[5, k]
            S[0, k] += Y[0, k] - (y * f2 - z * f1)
            S[1, k] += Y[1, k] - (z * f0 - x * f2)
            S[2, k] += Y[2, k] - (x * f1 - y * f0)
        at = 3 + 3 * i
        for r in range(3):
            for k in range(6):
                D[k, at + r] = S[r, k]
            N[at + r, 0] = S[r, GRADIENT]
            for k in range(W):
                N[at + r, GLOBALS + k] = S[r, SHAPE + k]
        for r in range(3):
            b0 = Y[r, 3]
            b1 = Y[r, 4]
            b2 = Y[r, 5]
            own = (Y[r, 0] + b1 * z - b2 * y, Y[r, 1] + b2 * x - b0 * z, Y[r, 2] + b0 * y - b1 * x)
            for s in range(3):
                D[at + r, at + s] += H[r, s]
                D[at + r, at + s] += own[s]
        j = i
        while j > 0:
            sx = pose.t[j, 0] - o[0]
            sy = pose.t[j, 1] - o[1]
            sz = pose.t[j, 2] - o[2]
            to = 3 + 3 * j
            for r in range(3):
                D[to, at + r] += S[r, 0] + S[r, 4] * sz - S[r, 5] * sy
                D[to + 1, at + r] += S[r, 1] + S[r, 5] * sx - S[r, 3] * sz
                D[to + 2, at + r] += S[r, 2] + S[r, 3] * sy - S[r, 4] * sx
            j = tree.parents[j]
    for r in range(6):
        for k in range(6):
            D[r, k] = sums[0, r, k]
        N[r, 0] = sums[0, r, GRADIENT]
        for k in range(W):
            N[r, GLOBALS + k] = sums[0, r, SHAPE + k]
    for a in range(W):
        c[a] += blocks.c[a]
        for b in range(a, W):
            C[a, b] += blocks.C[a, b]
