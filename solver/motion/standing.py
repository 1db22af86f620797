# SPDX-License-Identifier: GPL-3.0-or-later
r"""The velocity of points that stand still: a sole in contact is where it was one frame before.

    r = sqrt(w p / h) (p_f - p_{f-1}),   p = R_i (V_j beta + v_bar_j) + t_i in the world, metres
    dp = w x (p - t_0) + nu + sum of u_k x (p - t_k) over the joints k from the root to part i + (R_i V_j + D_i) dbeta
h is the time between the two frames, so that the cost is 1/2 integral of w p |v|^2 dt. Both frames move, unlike in
residuals/foot_contact.py, where the earlier position is a constant.
docs/solver_mathematics.md, "A whole clip", has the objective.
"""

from ..compiled.kernel import kernel
from ..residuals.accumulation import lever
from .system import GLOBALS, pose_of


@kernel
def _jacobian(tree, poses, f, j, p, J, columns) -> int:  # type: ignore[no-untyped-def]
    """Write p (3,), its Jacobian J (3, most) by the unknowns columns[:count] and then the shape; return count."""
    pose = pose_of(poses, f)
    i = tree.point_part[j]
    x, y, z = lever(tree, pose, j)
    p[0], p[1], p[2] = x + pose.t[i, 0], y + pose.t[i, 1], z + pose.t[i, 2]
    count = 0
    k = i
    while k >= 0:
        ex, ey, ez = p[0] - pose.t[k, 0], p[1] - pose.t[k, 1], p[2] - pose.t[k, 2]
        first = 0 if k == 0 else 3 + 3 * k
        for r in range(3):
            columns[count + r] = first + r
        # u x e: column r is the unit vector r crossed with e
        J[0, count], J[0, count + 1], J[0, count + 2] = 0.0, ez, -ey
        J[1, count], J[1, count + 1], J[1, count + 2] = -ez, 0.0, ex
        J[2, count], J[2, count + 1], J[2, count + 2] = ey, -ex, 0.0
        count += 3
        k = tree.parents[k]
    for r in range(3):
        columns[count + r] = 3 + r
        for s in range(3):
            J[r, count + s] = 1.0 if r == s else 0.0
    count += 3
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
        for b in range(count):
            D[row, columns[b]] += g0 * J[0, b] + g1 * J[1, b] + g2 * J[2, b]
        for b in range(P):
            N[row, GLOBALS + b] += sign * (g0 * moved[0, b] + g1 * moved[1, b] + g2 * moved[2, b])


@kernel
def accumulate(tree, poses, h, indices, probability, weight, scratch, columns, system) -> float:  # type: ignore[no-untyped-def]
    """Add the velocities of standing points to `system` and return their cost.

    :param poses: of `make_poses`; h (T,) seconds since the frame before; indices (C,), probability (T, C) of standing
    since the frame before; scratch (3, 3, 6 + 3K + W) and columns (6 + 3K,) are overwritten.
    """
    cost: float = 0.0
    P = tree.shape
    p, J = scratch[2], scratch
    for f in range(1, h.shape[0]):
        for k in range(indices.shape[0]):
            w = weight * probability[f, k] / h[f]
            if w <= 0.0:
                continue
            count = _jacobian(tree, poses, f - 1, indices[k], p[0], J[0], columns)
            _jacobian(tree, poses, f, indices[k], p[1], J[1], columns)
            for r in range(3):
                p[0, r] = p[1, r] - p[0, r]
                cost += 0.5 * w * p[0, r] * p[0, r]
                for a in range(P):
                    p[r, 3 + a] = J[1, r, count + a] - J[0, r, count + a]
            moved = p[:, 3 : 3 + P]
            _add_frame(system, f - 1, w, -1.0, p[0], J[0], columns, count, moved, P)
            _add_frame(system, f, w, 1.0, p[0], J[1], columns, count, moved, P)
            B = system.B1[f]
            for a in range(count):
                g0, g1, g2 = w * J[1, 0, a], w * J[1, 1, a], w * J[1, 2, a]
                for b in range(count):
                    B[columns[a], columns[b]] -= g0 * J[0, 0, b] + g1 * J[0, 1, b] + g2 * J[0, 2, b]
            for a in range(P):
                m0, m1, m2 = w * moved[0, a], w * moved[1, a], w * moved[2, a]
                system.c[a] += m0 * p[0, 0] + m1 * p[0, 1] + m2 * p[0, 2]
                for b in range(a, P):
                    system.C[a, b] += m0 * moved[0, b] + m1 * moved[1, b] + m2 * moved[2, b]
    return cost
