# SPDX-License-Identifier: GPL-3.0-or-later
"""Baseline for the sparse formulation: the paper's dense, unconstrained one, optimized as far as
possible.

The poses of the parts are functions of the root, the joint states and the shape, so a keypoint's
residual depends on every joint above it. The Jacobian J (rows, 6 + 3K + P) is filled by compiled
code, only where it is not zero; the normal equations are one BLAS call (numpy makes JᵀJ a symmetric
rank-k update), solved by Cholesky (LAPACK). The unknowns are the solver's, so that both give the
same step: the root's twist about the pelvis, u_1..K, beta.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.gauss_newton.linearize import clear_blocks, make_blocks, make_pose, place_parts
from ...solver.gauss_newton.terms import HAS_2D, HAS_3D, HAS_DIRECTION
from ...solver.kernel import kernel
from ...solver.part import GRADIENT
from ...solver.residuals import joint_flow, keypoint2d
from ...solver.residuals.accumulation import geman_mcclure
from ...solver.residuals.registry import (
    KEYPOINT2D,
    KEYPOINT3D,
    ORIENTATION_FIELD,
    RESIDUALS,
    SHAPE_PRIOR,
    column_of,
)
from .loops import put
from .problem import Problem

# the problem's one prior
FLOW = list(RESIDUALS).index("joint_flow")
FLOW_COLUMN = column_of("joint_flow")


@kernel
def _write_row(  # type: ignore[no-untyped-def]
    tree, pose, J, row, i, p, o, gx, gy, gz, moved, part_moves
) -> None:
    """Write one row of J for a gradient g with respect to the point p of part i; `moved` (3, P) is
    dp/dbeta.

    With `part_moves` = 0 the residual depends on the lever's direction only, which translations do
    not change.
    """
    ex = p[0] - o[0]
    ey = p[1] - o[1]
    ez = p[2] - o[2]
    k = i
    while k >= 0:
        at = 0 if k == 0 else 3 + 3 * k
        if part_moves:
            ex = p[0] - pose.t[k, 0]
            ey = p[1] - pose.t[k, 1]
            ez = p[2] - pose.t[k, 2]
        J[row, at] = ey * gz - ez * gy
        J[row, at + 1] = ez * gx - ex * gz
        J[row, at + 2] = ex * gy - ey * gx
        k = tree.parents[k]
    if part_moves:
        J[row, 3] = gx
        J[row, 4] = gy
        J[row, 5] = gz
    first = 3 + 3 * tree.parents.shape[0]
    for a in range(tree.shape_count):
        J[row, first + a] = gx * moved[0, a] + gy * moved[1, a] + gz * moved[2, a]


@kernel
def fill(tree, terms, stage, pose, J, r, moved) -> None:  # type: ignore[no-untyped-def]
    """Write J and r at `pose`, weighted, with the robust kernel by first-order reweighting."""
    place_parts(tree, pose)
    weights = stage[0]
    inv_sigma = stage[1]
    row = 0
    for i in range(tree.parents.shape[0]):
        R = pose.R[i]
        t = pose.t[i]
        for j in range(terms.starts[i], terms.starts[i + 1]):
            flags = terms.flags[j]
            v = terms.rest[j]
            x = v[0]
            y = v[1]
            z = v[2]
            for a in range(tree.shape_count):
                x += terms.V[j, 0, a] * pose.beta[a]
                y += terms.V[j, 1, a] * pose.beta[a]
                z += terms.V[j, 2, a] * pose.beta[a]
            lever = (
                R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
                R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
                R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
            )
            p = (lever[0] + t[0], lever[1] + t[1], lever[2] + t[2])
            for k in range(3):
                for a in range(tree.shape_count):
                    turned = (
                        R[k, 0] * terms.V[j, 0, a]
                        + R[k, 1] * terms.V[j, 1, a]
                        + R[k, 2] * terms.V[j, 2, a]
                    )
                    moved[0, k, a] = turned
                    moved[1, k, a] = turned + pose.D[i, k, a]
            if flags & HAS_2D:
                m = terms.image[j]
                iz = 1.0 / max(p[2], keypoint2d.Z_MIN)
                rx = p[0] * iz - m[0]
                ry = p[1] * iz - m[1]
                _, w = geman_mcclure(rx * rx + ry * ry, inv_sigma[KEYPOINT2D])
                w = np.sqrt(w * weights[KEYPOINT2D] * m[2])
                _write_row(
                    tree, pose, J, row, i, p, t, w * iz, 0.0, -w * p[0] * iz * iz, moved[1], 1
                )
                _write_row(
                    tree, pose, J, row + 1, i, p, t, 0.0, w * iz, -w * p[1] * iz * iz, moved[1], 1
                )
                r[row] = w * rx
                r[row + 1] = w * ry
                row += 2
            if flags & HAS_3D:
                m = terms.point[j]
                e = (p[0] - m[0], p[1] - m[1], p[2] - m[2])
                _, w = geman_mcclure(e[0] * e[0] + e[1] * e[1] + e[2] * e[2], inv_sigma[KEYPOINT3D])
                w = np.sqrt(w * weights[KEYPOINT3D] * m[3])
                _write_row(tree, pose, J, row, i, p, t, w, 0.0, 0.0, moved[1], 1)
                _write_row(tree, pose, J, row + 1, i, p, t, 0.0, w, 0.0, moved[1], 1)
                _write_row(tree, pose, J, row + 2, i, p, t, 0.0, 0.0, w, moved[1], 1)
                r[row] = w * e[0]
                r[row + 1] = w * e[1]
                r[row + 2] = w * e[2]
                row += 3
            if flags & HAS_DIRECTION:
                m = terms.direction[j]
                length = np.sqrt(lever[0] * lever[0] + lever[1] * lever[1] + lever[2] * lever[2])
                h = (lever[0] / length, lever[1] / length, lever[2] / length)
                e = (h[0] - m[0], h[1] - m[1], h[2] - m[2])
                _, w = geman_mcclure(
                    e[0] * e[0] + e[1] * e[1] + e[2] * e[2], inv_sigma[ORIENTATION_FIELD]
                )
                w = np.sqrt(w * weights[ORIENTATION_FIELD] * m[3])
                g = w / length
                for k in range(3):
                    gx = g * ((1.0 if k == 0 else 0.0) - h[k] * h[0])
                    gy = g * ((1.0 if k == 1 else 0.0) - h[k] * h[1])
                    gz = g * ((1.0 if k == 2 else 0.0) - h[k] * h[2])
                    _write_row(tree, pose, J, row + k, i, p, t, gx, gy, gz, moved[0], 0)
                    r[row + k] = w * e[k]
                row += 3
    first = 3 + 3 * tree.parents.shape[0]
    w = np.sqrt(weights[SHAPE_PRIOR])  # the population's shape prior: identity
    for a in range(tree.shape_count):
        J[row + a, first + a] = w
        r[row + a] = w * (pose.beta[a] - terms.shape_mean[a])


@kernel
def _solve(L, g, out) -> None:  # type: ignore[no-untyped-def]
    """Solve L Lᵀ out = -g."""
    n = g.shape[0]
    for i in range(n):
        s = -g[i]
        for k in range(i):
            s -= L[i, k] * out[k]
        out[i] = s / L[i, i]
    for i in range(n - 1, -1, -1):
        x = out[i] / L[i, i]
        out[i] = x
        for k in range(i):
            out[k] -= L[i, k] * x


@kernel
def _add_priors(tree, terms, stage, pose, blocks, H, g) -> None:  # type: ignore[no-untyped-def]
    """Add the prior of the joints' states, each of which is of one joint alone, to the normal
    equations.
    """
    clear_blocks(blocks)
    ints = terms.ints[FLOW]
    floats = terms.floats[FLOW]
    weight = stage[0, FLOW_COLUMN]
    joint_flow.accumulate(tree, ints, floats, weight, pose, blocks)
    for i in range(1, tree.parents.shape[0]):
        at = 3 + 3 * i
        for r in range(3):
            g[at + r] += blocks.H_u[i, r, GRADIENT]
            for c in range(3):
                H[at + r, at + c] += blocks.H_uu[i, r, c]


def solve_cholesky(H: NDArray[np.float64], g: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return -H⁻¹ g."""
    out = np.zeros(len(g))
    _solve(np.linalg.cholesky(H), g, out)
    return out


@dataclass
class Dense:
    """The dense step on a benchmark problem, with its buffers."""

    problem: Problem

    def __post_init__(self) -> None:
        """Make room for J."""
        terms = self.problem.terms
        tree = self.problem.tree
        counts = [np.count_nonzero(terms.flags & bit) for bit in (HAS_2D, HAS_3D, HAS_DIRECTION)]
        K = len(tree.parents) - 1
        P = tree.shape_count
        self.J = np.zeros((2 * counts[0] + 3 * counts[1] + 3 * counts[2] + P, 6 + 3 * K + P))
        self.r = np.zeros(len(self.J))
        self.moved = np.zeros((2, 3, max(P, 1)))
        self.pose, self.direction = make_pose(tree), np.zeros(self.J.shape[1])
        self.blocks = make_blocks(tree)
        self.priors = len(terms.ints[FLOW]) > 0
        damped = np.ones(self.J.shape[1])
        damped[3:6] = self.problem.root_scale**2
        damped[6 + 3 * K :] = 0.0
        self.damping = np.diag(self.problem.damping * damped)

    def step(self, k: int) -> NDArray[np.float64]:
        """Return the damped Gauss-Newton direction (6 + 3K + P) at state k of the bank."""
        p = self.problem
        put(p.bank, k, self.pose)
        fill(p.tree, p.terms, p.stage, self.pose, self.J, self.r, self.moved)
        H = self.J.T @ self.J
        H += self.damping
        g = self.J.T @ self.r
        if self.priors:
            _add_priors(p.tree, p.terms, p.stage, self.pose, self.blocks, H, g)
        _solve(np.linalg.cholesky(H), g, self.direction)
        return self.direction
