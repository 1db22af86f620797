# SPDX-License-Identifier: GPL-3.0-or-later
"""The alternative to block elimination over time: conjugate gradients on a whole clip,
preconditioned frame by frame.

Each frame's matrix is applied through the tree, never formed, and its recursion, with the temporal
terms' diagonal added, is the preconditioner. The shape is fixed and no point stands still, which
favours this method: beta would add columns to every operation, and contacts couple whole chains of
joints. See ../notebook/solver.md for the comparison.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...solver.gauss_newton.linearize import linearize, make_blocks
from ...solver.gauss_newton.recursion import eliminate, make_workspace
from ...solver.kernel import kernel
from ...solver.motion import acceleration
from ...solver.motion.problem import ClipProblem
from ...solver.motion.system import make_system, pose_of
from ...solver.motion.views import terms_of
from ...solver.part import Pose


@kernel
def apply_frame(  # type: ignore[no-untyped-def]
    tree, pose, blocks, damping, root_scale, x, d, out
) -> None:
    """Write (H_f + Lambda) d to out (n,); x (K+1, 6) is overwritten."""
    o = pose.t[0]
    n = tree.parents.shape[0]
    for r in range(6):
        x[0, r] = d[r]
    for i in range(1, n):
        u0 = d[3 + 3 * i]
        u1 = d[4 + 3 * i]
        u2 = d[5 + 3 * i]
        sx = pose.t[i, 0] - o[0]
        sy = pose.t[i, 1] - o[1]
        sz = pose.t[i, 2] - o[2]
        z = x[tree.parents[i]]
        x[i, 0] = z[0] + u0
        x[i, 1] = z[1] + u1
        x[i, 2] = z[2] + u2
        x[i, 3] = z[3] + sy * u2 - sz * u1
        x[i, 4] = z[4] + sz * u0 - sx * u2
        x[i, 5] = z[5] + sx * u1 - sy * u0
    for i in range(n):
        a, b, c, e, f, g = x[i]
        A = blocks.A[i]
        for r in range(6):
            x[i, r] = (
                A[r, 0] * a + A[r, 1] * b + A[r, 2] * c + A[r, 3] * e + A[r, 4] * f + A[r, 5] * g
            )
    for i in range(n - 1, 0, -1):
        y = x[i]
        H = blocks.H_uu[i]
        at = 3 + 3 * i
        sx = pose.t[i, 0] - o[0]
        sy = pose.t[i, 1] - o[1]
        sz = pose.t[i, 2] - o[2]
        turned = (sy * y[5] - sz * y[4], sz * y[3] - sx * y[5], sx * y[4] - sy * y[3])
        for r in range(3):
            own = H[r, 0] * d[at] + H[r, 1] * d[at + 1] + H[r, 2] * d[at + 2]
            out[at + r] = y[r] - turned[r] + own + damping * d[at + r]
        up = x[tree.parents[i]]
        for r in range(6):
            up[r] += y[r]
    for r in range(6):
        out[r] = x[0, r] + damping * (1.0 if r < 3 else root_scale * root_scale) * d[r]


@kernel
def precondition_frame(tree, pose, work, m, q, r, z) -> None:  # type: ignore[no-untyped-def]
    """Write z (n,) = (the matrix that `eliminate` factorized)^-1 r; m (K+1, 6) and q (K+1, 3) are
    overwritten.
    """
    o = pose.t[0]
    n = tree.parents.shape[0]
    for i in range(n):
        for k in range(6):
            m[i, k] = 0.0
    for i in range(n - 1, 0, -1):
        y = m[i]
        at = 3 + 3 * i
        F = work.L[i]
        T = work.Y[i]
        sx = pose.t[i, 0] - o[0]
        sy = pose.t[i, 1] - o[1]
        sz = pose.t[i, 2] - o[2]
        a = r[at] + y[0] - (sy * y[5] - sz * y[4])
        b = r[at + 1] + y[1] - (sz * y[3] - sx * y[5])
        c = r[at + 2] + y[2] - (sx * y[4] - sy * y[3])
        q0 = F[0] * a
        q1 = F[1] * a + F[2] * b
        q2 = F[3] * a + F[4] * b + F[5] * c
        q[i, 0] = q0
        q[i, 1] = q1
        q[i, 2] = q2
        up = m[tree.parents[i]]
        for k in range(6):
            up[k] += y[k] - T[0, k] * q0 - T[1, k] * q1 - T[2, k] * q2
    root = work.root
    for k in range(6):
        s = r[k] + m[0, k]
        for j in range(k):
            s -= root[j, k] * z[j]
        z[k] = s * root[k, k]
    for k in range(5, -1, -1):
        s = z[k]
        for j in range(k + 1, 6):
            s -= root[k, j] * z[j]
        z[k] = s * root[k, k]
    for k in range(6):
        m[0, k] = z[k]
    for i in range(1, n):
        x = m[tree.parents[i]]
        T = work.Y[i]
        F = work.L[i]
        at = 3 + 3 * i
        s0 = q[i, 0]
        s1 = q[i, 1]
        s2 = q[i, 2]
        for k in range(6):
            s0 -= T[0, k] * x[k]
            s1 -= T[1, k] * x[k]
            s2 -= T[2, k] * x[k]
        u0 = F[0] * s0 + F[1] * s1 + F[3] * s2
        u1 = F[2] * s1 + F[4] * s2
        u2 = F[5] * s2
        z[at] = u0
        z[at + 1] = u1
        z[at + 2] = u2
        sx = pose.t[i, 0] - o[0]
        sy = pose.t[i, 1] - o[1]
        sz = pose.t[i, 2] - o[2]
        m[i, 0] = x[0] + u0
        m[i, 1] = x[1] + u1
        m[i, 2] = x[2] + u2
        m[i, 3] = x[3] + sy * u2 - sz * u1
        m[i, 4] = x[4] + sz * u0 - sx * u2
        m[i, 5] = x[5] + sx * u1 - sy * u0


@kernel
def add_couplings(D, B1, B2, d, out) -> None:  # type: ignore[no-untyped-def]
    """Add the temporal terms' product with d (T, n) to out; each (T, K+2, 3, 3): blocks (f, f), (f,
    f-1), (f, f-2).
    """
    last = D.shape[1] - 1
    for f in range(D.shape[0]):
        for k in range(last + 1):
            at = 3 if k == last else (0 if k == 0 else 3 + 3 * k)
            for r in range(3):
                s = 0.0
                for c in range(3):
                    s += D[f, k, r, c] * d[f, at + c]
                    if f > 0:
                        s += B1[f, k, r, c] * d[f - 1, at + c]
                        out[f - 1, at + c] += B1[f, k, r, c] * d[f, at + r]
                    if f > 1:
                        s += B2[f, k, r, c] * d[f - 2, at + c]
                        out[f - 2, at + c] += B2[f, k, r, c] * d[f, at + r]
                out[f, at + r] += s


class ConjugateGradients:
    """The damped step of a clip of fixed shape, one own-axes camera and no contacts, by conjugate
    gradients.
    """

    def __init__(
        self, problem: ClipProblem, poses: Pose, damping: float, root_scale: float
    ) -> None:
        """Linearize and factorize every frame."""
        tree = problem.tree
        T = problem.frames
        self.tree = tree
        self.damping = damping
        self.root_scale = root_scale
        temporal = make_system(tree, T)
        self.poses = [pose_of(poses, f) for f in range(T)]
        self.blocks = [make_blocks(tree) for _ in range(T)]
        self.work = [make_workspace(tree) for _ in range(T)]
        stage = problem.settings.stages[0]
        for f in range(T):
            linearize(
                tree,
                terms_of(problem.views, f),
                stage,
                self.poses[f],
                self.blocks[f],
                self.work[f].scratch,
            )
        acceleration.accumulate(
            tree, poses, problem.motion, 0, T, acceleration.make_memory(tree), temporal
        )
        K = len(tree.parents) - 1
        at = [0, *(3 + 3 * k for k in range(1, K + 1)), 3]
        pick = [np.ix_(range(a, a + 3), range(a, a + 3)) for a in at]
        self.D = np.array([[temporal.D[f][p] for p in pick] for f in range(T)])
        self.B1 = temporal.B1
        self.B2 = temporal.B2
        for f in range(T):  # the diagonal goes to the preconditioner
            added = [a.copy() for a in (self.blocks[f].H_uu, self.blocks[f].A)]
            self.blocks[f].H_uu[1:] += self.D[f, 1:-1]
            self.blocks[f].A[0, :3, :3] += self.D[f, 0]
            self.blocks[f].A[0, 3:6, 3:6] += self.D[f, -1]
            eliminate(tree, self.poses[f], self.blocks[f], damping, root_scale, self.work[f])
            self.blocks[f].H_uu[:], self.blocks[f].A[:] = added
        self.x = np.zeros((K + 1, 6))
        self.q = np.zeros((K + 1, 3))

    def multiply(self, d: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the product with the clip's damped matrix."""
        out = np.zeros_like(d)
        for f, (pose, blocks) in enumerate(zip(self.poses, self.blocks, strict=True)):
            apply_frame(
                self.tree, pose, blocks, self.damping, self.root_scale, self.x, d[f], out[f]
            )
        add_couplings(self.D, self.B1, self.B2, d, out)
        return out

    def precondition(self, r: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the product with the inverse of the preconditioner."""
        z = np.zeros_like(r)
        for f, (pose, work) in enumerate(zip(self.poses, self.work, strict=True)):
            precondition_frame(self.tree, pose, work, self.x, self.q, r[f], z[f])
        return z

    def solve(
        self, gradient: NDArray[np.float64], tolerance: float, most: int = 2000
    ) -> tuple[NDArray[np.float64], int]:
        """Return the step (T, n) and the number of iterations until |residual| <= tolerance
        |gradient|.
        """
        d = np.zeros_like(gradient)
        r = -gradient
        z = self.precondition(r)
        p = z.copy()
        rz = float(np.vdot(r, z))
        wanted = tolerance * np.linalg.norm(gradient)
        for k in range(1, most + 1):
            Hp = self.multiply(p)
            step = rz / float(np.vdot(p, Hp))
            d += step * p
            r -= step * Hp
            if np.linalg.norm(r) <= wanted:
                return d, k
            z = self.precondition(r)
            rz, before = float(np.vdot(r, z)), rz
            p = z + (rz / before) * p
        return d, most
