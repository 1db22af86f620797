# SPDX-License-Identifier: GPL-3.0-or-later
r"""The velocity of points that stand still: a sole in contact is where it was one frame before.

    r = sqrt(w p / h) (p_f - p_{f-1}),   p = R_i (V_j beta + v_bar_j) + t_i in the world, metres
    dp = w x (p - t_0) + nu + sum of u_k x (p - t_k) over the joints k from the root to part i + (R_i V_j + D_i) dbeta
h is the time between the two frames, so that the cost is 1/2 integral of w p |v|^2 dt. Both frames move, unlike in
residuals/foot_contact.py, where the earlier position is a constant.
docs/solver_mathematics.md, "A whole clip", has the objective.
"""

from typing import NamedTuple

import numpy as np

from ..compiled.kernel import kernel
from ..compiled.part import Array
from ..compiled.tree import Tree
from ..residuals.accumulation import lever
from .system import GLOBALS, pose_of


class Memory(NamedTuple):
    """What one thread works in; [f % 2] is of frame f. C points."""

    p: Array  # (2, C, 3) the points
    J: Array  # (2, C, 3, 6 + 3K + W) their Jacobians by the unknowns `columns` and then the shape
    columns: Array  # (C, 6 + 3K) in ascending order
    counts: Array  # (C,) of them
    r: Array  # (3,)
    moved: Array  # (3, W)


def make_memory(tree: Tree, points: int) -> Memory:
    """Return the memory for that many points."""
    unknowns, W = 3 + 3 * len(tree.parents), tree.S.shape[2]
    shapes: list[tuple[int, ...]] = [(2, points, 3), (2, points, 3, unknowns + W)]
    columns, counts = np.zeros((points, unknowns), np.int64), np.zeros(points, np.int64)
    return Memory(*(np.zeros(shape) for shape in shapes), columns, counts, np.zeros(3), np.zeros((3, W)))


@kernel
def _jacobian(tree, poses, f, j, p, J, columns) -> int:  # type: ignore[no-untyped-def]
    """Write p (3,), its Jacobian J (3, most) by the unknowns columns[:count] and then the shape; return count."""
    pose = pose_of(poses, f)
    i = tree.point_part[j]
    x, y, z = lever(tree, pose, j)
    p[0], p[1], p[2] = x + pose.t[i, 0], y + pose.t[i, 1], z + pose.t[i, 2]
    count, k = 3, i
    while k >= 0:
        count += 3
        k = tree.parents[k]
    at, k = count - 3, i
    while k >= 0:
        if k == 0:
            at = 0
        ex, ey, ez = p[0] - pose.t[k, 0], p[1] - pose.t[k, 1], p[2] - pose.t[k, 2]
        for r in range(3):
            columns[at + r] = r if k == 0 else 3 + 3 * k + r
        # u x e: column r is the unit vector r crossed with e
        J[0, at], J[0, at + 1], J[0, at + 2] = 0.0, ez, -ey
        J[1, at], J[1, at + 1], J[1, at + 2] = -ez, 0.0, ex
        J[2, at], J[2, at + 1], J[2, at + 2] = ey, -ex, 0.0
        at -= 3
        k = tree.parents[k]
    for r in range(3):
        columns[3 + r] = 3 + r
        for s in range(3):
            J[r, 3 + s] = 1.0 if r == s else 0.0
    R = pose.R[i]
    for a in range(tree.shape):
        for r in range(3):
            turned = R[r, 0] * tree.V[j, 0, a] + R[r, 1] * tree.V[j, 1, a] + R[r, 2] * tree.V[j, 2, a]
            J[r, count + a] = turned + pose.D[i, r, a]
    return count


@kernel
def _add_frame(system, f, weight, sign, r, J, columns, count, moved, P) -> None:  # type: ignore[no-untyped-def]
    """Add what the residual r (3,) gives to frame f alone: its block, gradient and global columns."""
    D, N = system.D[f], system.N[f]
    for a in range(count):
        g0, g1, g2 = weight * J[0, a], weight * J[1, a], weight * J[2, a]
        row = columns[a]
        N[row, 0] += sign * (g0 * r[0] + g1 * r[1] + g2 * r[2])
        for b in range(a, count):
            D[row, columns[b]] += g0 * J[0, b] + g1 * J[1, b] + g2 * J[2, b]
        for b in range(P):
            N[row, GLOBALS + b] += sign * (g0 * moved[0, b] + g1 * moved[1, b] + g2 * moved[2, b])


@kernel
def accumulate(  # type: ignore[no-untyped-def]
    tree, poses, h, indices, probability, weight, first, last, memory, system, C, c
) -> float:
    """Add the velocities of standing points at frames first..last-1 to `system`, C and c, and return their cost.

    :param poses: of `make_poses`; h (T,) seconds since the frame before; indices (C,), probability (T, C) of standing
    since the frame before; memory of `make_memory` is overwritten; C (W, W) upper triangle, c (W,).
    """
    cost: float = 0.0
    P = tree.shape
    r, moved, columns, counts = memory.r, memory.moved, memory.columns, memory.counts
    first = max(first, 1)
    for f in range(first, last):
        for k in range(indices.shape[0]):
            w = weight * probability[f, k] / h[f]
            if w <= 0.0:
                continue
            e = f % 2
            if f == first or weight * probability[f - 1, k] / h[f - 1] <= 0.0:
                p, J = memory.p[1 - e, k], memory.J[1 - e, k]
                counts[k] = _jacobian(tree, poses, f - 1, indices[k], p, J, columns[k])
            _jacobian(tree, poses, f, indices[k], memory.p[e, k], memory.J[e, k], columns[k])
            count, before, J = counts[k], memory.J[1 - e, k], memory.J[e, k]
            for s in range(3):
                r[s] = memory.p[e, k, s] - memory.p[1 - e, k, s]
                cost += 0.5 * w * r[s] * r[s]
                for a in range(P):
                    moved[s, a] = J[s, count + a] - before[s, count + a]
            _add_frame(system, f - 1, w, -1.0, r, before, columns[k], count, moved, P)
            _add_frame(system, f, w, 1.0, r, J, columns[k], count, moved, P)
            B = system.B1[f]
            for a in range(count):
                g0, g1, g2 = w * J[0, a], w * J[1, a], w * J[2, a]
                for b in range(count):
                    B[columns[k, a], columns[k, b]] -= g0 * before[0, b] + g1 * before[1, b] + g2 * before[2, b]
            for a in range(P):
                m0, m1, m2 = w * moved[0, a], w * moved[1, a], w * moved[2, a]
                c[a] += m0 * r[0] + m1 * r[1] + m2 * r[2]
                for b in range(a, P):
                    C[a, b] += m0 * moved[0, b] + m1 * moved[1, b] + m2 * moved[2, b]
    return cost
