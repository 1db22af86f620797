# SPDX-License-Identifier: Apache-2.0
r"""Marginal covariances of a clip's joints and of its global columns, by selected inversion of the
factor.

Row i of a frame's factor, divided by its pivot, says how unknown i follows from those that are
eliminated after it: the later ones of the frame, the two frames after it and the global columns.
With R_ij the row, S the covariance of all these, and u_i the pivot,
    S_ij = -sum over k > i of R_ik S_kj / u_i,
    S_ii = 1/u_i^2 - sum over k > i of R_ik S_ki / u_i
so the diagonal blocks follow in one pass in opposite order, with nothing wider than 3 n + W. A
joint's position is linear in these unknowns: t_i = t_0 + sum over its parents, dt_i = J_i d_f + D_i
dbeta. The scale is that of the weights, which are inverse variances. Source: the recursion for the
entries of a sparse inverse by Takahashi, Fagan and Chin (1973).
"""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from ..gauss_newton.optimizer import MIN_DAMPING
from ..gauss_newton.recursion import copy_rows, subtract_row
from ..kernel import kernel
from ..part import Array, Pose
from ..tree import Tree
from .band import Factor, eliminate_clip, middle_of, run_both
from .system import GLOBALS, ClipSystem, write_turn


class ClipCovariance(NamedTuple):
    """Covariances of T frames and of what they share."""

    joints: Array  # (T, K+1, 3, 3) of the joints' positions, metres^2
    from_root: Array  # (T, K+1, 3, 3) of their positions relative to part 0
    shared: Array  # (G, G) of the global columns


class _Memory(NamedTuple):
    """What one thread works in."""

    S: Array  # (3 n + W, 3 n + W): the frame, the two eliminated after it, the global columns
    J: Array  # (2, 3, 6 + 3K + W)
    columns: Array  # (6 + 3K + W,) integers


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
    G = tree.globals
    parts = len(tree.parents)
    W = len(factor.c)
    shared = _shared_covariance(factor.C[:G, :G])
    middle = middle_of(T)
    out = ClipCovariance(np.empty((T, parts, 3, 3)), np.empty((T, parts, 3, 3)), shared)
    front = _make_memory(n, W, parts)
    back = _make_memory(n, W, parts)
    front.S[3 * n : 3 * n + G, 3 * n : 3 * n + G] = shared
    both = min(T, 2)
    _select(tree, poses, factor.Z, middle + both - 1, both, -1, front, out.joints, out.from_root)
    # seen from the back, the first of the two frames is the later one
    order = np.r_[:n, 2 * n : 3 * n, n : 2 * n, 3 * n : 3 * n + W]
    back.S[:] = front.S[np.ix_(order, order)]
    half = (
        tree,
        poses,
        factor.Z,
        middle + 2,
        max(T - 2 - middle, 0),
        1,
        back,
        out.joints,
        out.from_root,
    )
    run_both(
        pool,
        _select,
        (tree, poses, factor.Z, middle - 1, middle, -1, front, out.joints, out.from_root),
        half,
    )
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


def _make_memory(n: int, W: int, parts: int) -> _Memory:
    size = 3 * n + W
    columns = 3 + 3 * parts + W
    return _Memory(
        np.zeros((size, size)),
        np.zeros((2, 3, columns)),
        np.zeros(columns, dtype=np.int64),
    )


@kernel
def _select(  # type: ignore[no-untyped-def]
    tree, poses, Z, first, count, step, memory, joints, from_root
) -> None:
    """Write the covariances of `count` frames from `first` on, by step 1 or -1, each eliminated
    before the last one.
    """
    n = Z.shape[1]
    for k in range(count):
        f = first + step * k
        _invert_frame(Z[f], n, memory.S)
        _write_joints(tree, poses, f, memory, joints[f], from_root[f])
        _advance(n, memory.S)


@kernel
def _invert_frame(Z, n: int, S) -> None:  # type: ignore[no-untyped-def]
    """Fill the rows and columns of S (3 n + W, 3 n + W) of a frame, from those of what was
    eliminated after it.

    An unknown without a pivot, of which Z holds the inverse 0, is fixed by nothing but a damping
    that was lost in rounding: it varies as if by that alone.
    """
    size = S.shape[0]
    for i in range(n - 1, -1, -1):
        u = Z[i, i]  # the inverse of the pivot
        for j in range(i + 1, size):
            S[i, j] = 0.0
        for k in range(i + 1, size):
            share = u * (Z[i, k] if k < 3 * n else Z[i, k + GLOBALS])
            subtract_row(S[k, i + 1 :], share, S[i, i + 1 :])
        variance = u * u if u > 0.0 else 1.0 / MIN_DAMPING
        for k in range(i + 1, size):
            share = u * (Z[i, k] if k < 3 * n else Z[i, k + GLOBALS])
            variance -= share * S[i, k]
            S[k, i] = S[i, k]
        S[i, i] = variance


@kernel
def _advance(n: int, S) -> None:  # type: ignore[no-untyped-def]
    """Move S by one frame: its frame becomes the first of the two after the next one."""
    first = slice(0, n)
    second = slice(n, 2 * n)
    third = slice(2 * n, 3 * n)
    shared = slice(3 * n, S.shape[0])
    for to, source in ((third, second), (second, first)):
        copy_rows(S[source, shared], S[to, shared])
        copy_rows(S[shared, source], S[shared, to])
    copy_rows(S[second, second], S[third, third])
    copy_rows(S[first, second], S[second, third])
    copy_rows(S[second, first], S[third, second])
    copy_rows(S[first, first], S[second, second])


@kernel
def _write_joints(  # type: ignore[no-untyped-def]
    tree, poses, f, memory, joints, from_root
) -> None:
    """Write the covariances (K+1, 3, 3) of the joints' positions, and relative to part 0, of frame
    f.
    """
    n = (memory.S.shape[0] - tree.S.shape[2]) // 3
    J = memory.J
    columns = memory.columns
    t = poses.t[f]
    D = poses.D[f]
    for i in range(tree.parents.shape[0]):
        count = 0
        k = tree.parents[i]
        while k >= 0:
            for r in range(3):
                columns[count + r] = r if k == 0 else 3 + 3 * k + r
            e = (t[i, 0] - t[k, 0], t[i, 1] - t[k, 1], t[i, 2] - t[k, 2])
            write_turn(*e, J[0], count)
            count += 3
            k = tree.parents[k]
        for a in range(tree.shape):
            columns[count] = 3 * n + a
            for r in range(3):
                J[0, r, count] = D[i, r, a]
            count += 1
        _project(memory.S, J, columns, count, from_root[i])
        for s in range(3):
            columns[count + s] = 3 + s
            for r in range(3):
                J[0, r, count + s] = 1.0 if r == s else 0.0
        _project(memory.S, J, columns, count + 3, joints[i])


@kernel
def _project(S, J, columns, count: int, out) -> None:  # type: ignore[no-untyped-def]
    """Write J S Jᵀ (3, 3) to out: rows and columns columns[:count] of S, J[0] (3, count). J[1] is
    overwritten.
    """
    for b in range(count):
        x = y = z = 0.0
        for a in range(count):
            s = S[columns[b], columns[a]]
            x += J[0, 0, a] * s
            y += J[0, 1, a] * s
            z += J[0, 2, a] * s
        J[1, 0, b] = x
        J[1, 1, b] = y
        J[1, 2, b] = z
    for r in range(3):
        for s in range(r, 3):
            value = 0.0
            for a in range(count):
                value += J[1, r, a] * J[0, s, a]
            out[r, s] = value
            out[s, r] = value
