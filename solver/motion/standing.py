# SPDX-License-Identifier: Apache-2.0
r"""The velocity of points that stand still: a sole in contact is where it was one frame before.

    r = sqrt(w p / h) (p_f - p_{f-1}),   p = R_i (V_j beta + v_bar_j) + t_i in the world, metres
    dp = w x (p - t_0) + nu + sum of u_k x (p - t_k) over the joints k from the root to part i
         + (R_i V_j + D_i) dbeta
h is the time between the two frames, so that the cost is 1/2 integral of w p |v|^2 dt. Both frames
move, unlike in residuals/foot_contact.py, where the earlier position is a constant.
docs/solver_mathematics.md, "A whole clip", has the objective.
"""

from ..kernel import kernel
from ..residuals.accumulation import lever, shape_derivative
from .system import GLOBALS, pose_of


@kernel
def _jacobian(tree, poses, f, j, count, p, J) -> None:  # type: ignore[no-untyped-def]
    """Write point j (3,) and its derivatives J (3, count + W) by the unknowns that move it, and by
    the shape.
    """
    pose = pose_of(poses, f)
    i = tree.point_part[j]
    x, y, z = lever(tree, pose, j)
    p[0] = x + pose.t[i, 0]
    p[1] = y + pose.t[i, 1]
    p[2] = z + pose.t[i, 2]
    at = count - 3
    k = i
    while k >= 0:
        if k == 0:
            at = 0
        for r in range(3):  # the derivative of u x (p - t_k) by u
            J[r, at + r] = 0.0
            e = p[r] - pose.t[k, r]
            J[(r + 1) % 3, at + (r + 2) % 3] = e
            J[(r + 2) % 3, at + (r + 1) % 3] = -e
        at -= 3
        k = tree.parents[k]
    for r in range(3):
        for s in range(3):
            J[r, 3 + s] = 1.0 if r == s else 0.0
    for a in range(tree.shape_count):
        B = shape_derivative(tree, pose, j, i, a)
        for r in range(3):
            J[r, count + a] = B[r]


@kernel
def place_points(tree, poses, motion, first, last, system) -> None:  # type: ignore[no-untyped-def]
    """Fill `system.contacts` at frames first..last-1, and add what the points say of each frame
    alone to its block.

    :param poses: of `make_poses`; motion `MotionTerms`.
    """
    w, p, J, columns, counts = system.contacts
    for f in range(first, last):
        D = system.D[f]
        for k in range(counts.shape[0]):
            w[f, k] = both = motion.contact * motion.probability[f, k] / motion.h[f]
            if f + 1 < motion.h.shape[0]:
                both += motion.contact * motion.probability[f + 1, k] / motion.h[f + 1]
            if both <= 0.0:
                continue
            own = J[f, k]
            count = counts[k]
            _jacobian(tree, poses, f, motion.indices[k], count, p[f, k], own)
            for a in range(count):
                g0 = both * own[0, a]
                g1 = both * own[1, a]
                g2 = both * own[2, a]
                row = columns[k, a]
                for b in range(a, count):
                    D[row, columns[k, b]] += g0 * own[0, b] + g1 * own[1, b] + g2 * own[2, b]


@kernel
def _add_gradient(N, J, columns, count, force, moved, P) -> None:  # type: ignore[no-untyped-def]
    """Add Jᵀ force and the global columns Jᵀ moved to N (n, 4+W); J (3, count+W), force (3,), moved
    (3, W).
    """
    for a in range(count):
        x = J[0, a]
        y = J[1, a]
        z = J[2, a]
        N[columns[a], 0] += x * force[0] + y * force[1] + z * force[2]
        for b in range(P):
            N[columns[a], GLOBALS + b] += x * moved[0, b] + y * moved[1, b] + z * moved[2, b]


@kernel
def accumulate(tree, first, last, work, system, C, c) -> float:  # type: ignore[no-untyped-def]
    """Add the rest of what standing points say at frames first..last-1 to `system`, C and c; return
    their cost.

    `place_points` comes first, at the frame before them as well. C (W, W) upper triangle, c (W,);
    work (3, 1+W) is overwritten.
    """
    cost: float = 0.0
    P = tree.shape_count
    w, p, J, columns, counts = system.contacts
    force = work[:, 0]
    moved = work[:, 1:]
    for f in range(max(first, 1), last):
        for k in range(counts.shape[0]):
            weight = w[f, k]
            count = counts[k]
            if weight <= 0.0:
                continue
            for r in range(3):
                d = p[f, k, r] - p[f - 1, k, r]
                cost += 0.5 * weight * d * d
                force[r] = weight * d
                for a in range(P):
                    moved[r, a] = weight * (J[f, k, r, count + a] - J[f - 1, k, r, count + a])
            for a in range(P):
                m0 = moved[0, a] / weight
                m1 = moved[1, a] / weight
                m2 = moved[2, a] / weight
                c[a] += m0 * force[0] + m1 * force[1] + m2 * force[2]
                for b in range(a, P):
                    C[a, b] += m0 * moved[0, b] + m1 * moved[1, b] + m2 * moved[2, b]
            _add_gradient(system.N[f], J[f, k], columns[k], count, force, moved, P)
            for r in range(3):
                force[r] = -force[r]
                for a in range(P):
                    moved[r, a] = -moved[r, a]
            _add_gradient(system.N[f - 1], J[f - 1, k], columns[k], count, force, moved, P)
    return cost
