# SPDX-License-Identifier: Apache-2.0
r"""Acceleration over three frames, of joints relative to their parents and of the root in the
world.

    phi_f = log(Omega_{f-1}ᵀ Omega_f),    v_f = phi_f / h_f,    a_f = (v_f - v_{f-1}) / h,
    h = (h_f + h_{f-1}) / 2
    cost  1/2 w h rho(|a_f|^2),   h_f the time from frame f-1 to f in seconds
With Omega <- exp(b) Omega in the parent's axes, b = R_parᵀ u, and J^-1 the inverse left Jacobian,
    d phi_f = J^-1(phi_f) Omega_{f-1}ᵀ (b_f - b_{f-1})
The root's rotation enters in the same way, b = w, and its position with v_f = (t_f - t_{f-1}) /
h_f, dt = nu. What the angular velocity of the root is measured in does not matter: its derivative
is the same in body axes, turned. Robust, so that hits and landings stay sharp.
docs/solver_mathematics.md, "A whole clip", has the objective.
"""

from typing import NamedTuple

import numpy as np

from ..kernel import kernel
from ..matrices import entries, product, transposed, write_entries
from ..part import Array
from ..residuals.accumulation import geman_mcclure, relative_log
from ..rotations import left_jacobian_inverse3
from ..tree import Tree


@kernel
def _velocity(A, B, h, phi, J) -> None:  # type: ignore[no-untyped-def]
    """Write phi = log(AᵀB) / h (3,) and J = J^-1(log(AᵀB)) Aᵀ / h (3, 3)."""
    difference = relative_log(A.reshape(9), B)
    write_entries(product(left_jacobian_inverse3(*difference), transposed(entries(A))), J)
    for r in range(3):
        phi[r] = difference[r] / h
        for s in range(3):
            J[r, s] /= h


@kernel
def _add(system, f, at, slot, a, J, weight) -> None:  # type: ignore[no-untyped-def]
    """Add a residual a (3,) of frames f-2, f-1, f with Jacobians J (3 frames, 3, 3) by the unknowns
    from `at` on.
    """
    for p in range(3):
        to = f - 2 + p
        for r in range(3):
            J0 = weight * J[p, 0, r]
            J1 = weight * J[p, 1, r]
            J2 = weight * J[p, 2, r]
            system.N[to, at + r, 0] += J0 * a[0] + J1 * a[1] + J2 * a[2]
            for q in range(p + 1):
                for s in range(3):
                    value = J0 * J[q, 0, s] + J1 * J[q, 1, s] + J2 * J[q, 2, s]
                    if q == p:
                        system.D[to, at + r, at + s] += value
                    elif q == p - 1:
                        system.B1[to, slot, r, s] += value
                    else:
                        system.B2[to, slot, r, s] += value


class Memory(NamedTuple):
    """What one thread works in; [f % 2] is of the step from frame f-1 to f."""

    v: Array  # (2, K+2, 3) velocities
    M: Array  # (2, K+2, 3, 3) their derivatives
    a: Array  # (3,)
    J: Array  # (3, 3, 3)


def make_memory(tree: Tree) -> Memory:
    """Return the memory for the parts of `tree` and the root's position."""
    rows = len(tree.parents) + 1
    return Memory(
        np.zeros((2, rows, 3)), np.zeros((2, rows, 3, 3)), np.zeros(3), np.zeros((3, 3, 3))
    )


@kernel
def _velocities(tree, poses, h, table, f, v, M) -> None:  # type: ignore[no-untyped-def]
    """Write the velocities v (K+2, 3) from frame f-1 to f and their derivatives M (K+2, 3, 3) by
    frame f.
    """
    parts = tree.parents.shape[0]
    for k in range(parts):
        if table[k, 0] > 0.0:
            turned = poses.R if k == 0 else poses.Omega
            _velocity(turned[f - 1, k], turned[f, k], h[f], v[k], M[k])
    for r in range(3):
        v[parts, r] = (poses.t[f, 0, r] - poses.t[f - 1, 0, r]) / h[f]
        for s in range(3):
            M[parts, r, s] = 1.0 / h[f] if r == s else 0.0


@kernel
def accumulate(  # type: ignore[no-untyped-def]
    tree, poses, motion, first, last, memory, system
) -> float:
    """Add the accelerations at frames first..last-1 of a clip to `system` and return their cost.

    :param poses: of `make_poses`; motion `MotionTerms`; memory of `make_memory` is overwritten.
    """
    cost: float = 0.0
    parts = tree.parents.shape[0]
    first = max(first, 2)
    a = memory.a
    J = memory.J
    h = motion.h
    table = motion.table
    for f in range(first, last):
        if f == first:
            _velocities(tree, poses, h, table, f - 1, memory.v[(f - 1) % 2], memory.M[(f - 1) % 2])
        before = memory.M[(f - 1) % 2]
        after = memory.M[f % 2]
        v_before = memory.v[(f - 1) % 2]
        v_after = memory.v[f % 2]
        _velocities(tree, poses, h, table, f, v_after, after)
        mean = 0.5 * (h[f] + h[f - 1])
        for k in range(parts + 1):
            weight = table[k, 0] * mean
            if weight <= 0.0:
                continue
            s2 = 0.0
            for r in range(3):
                a[r] = (v_after[k, r] - v_before[k, r]) / mean
                s2 += a[r] * a[r]
                for s in range(3):
                    J[0, r, s] = before[k, r, s] / mean
                    J[1, r, s] = -(before[k, r, s] + after[k, r, s]) / mean
                    J[2, r, s] = after[k, r, s] / mean
            if 0 < k < parts:
                for p in range(3):
                    R_parent_camera = transposed(entries(poses.R[f - 2 + p, tree.parents[k]]))
                    write_entries(product(entries(J[p]), R_parent_camera), J[p])
            rho, w = geman_mcclure(s2, table[k, 1])
            cost += 0.5 * weight * rho
            at = 3 if k == parts else (0 if k == 0 else 3 + 3 * k)
            _add(system, f, at, k, a, J, weight * w)
    return cost
