# SPDX-License-Identifier: Apache-2.0
"""Levenberg-Marquardt over all poses of a clip and what they share.

What Gauss-Newton leaves out of the joints' Hessians is learned over the clip, as
gauss_newton/curvature.py does in a frame.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba.extending import register_jitable

from ..gauss_newton.curvature import Curvature, allowed_part, set_current, update
from ..gauss_newton.optimizer import MIN_DAMPING, SeveralFrames
from ..gauss_newton.recursion import move
from ..kernel import kernel
from ..matrices import entries, turned
from ..part import Array, Blocks, Pose
from .band import eliminate_clip, make_factor, solve_clip
from .problem import ClipProblem
from .system import make_poses, pose_of


@register_jitable
def _blocks_of(joints: Blocks, f: int) -> Blocks:
    return Blocks(joints.A, joints.H_u[f], joints.H_uu[f], joints.C, joints.c, joints.cross)


@register_jitable
def _curvature_of(curvature: Curvature, f: int) -> Curvature:
    return Curvature(curvature.S[f], curvature.H[f], curvature.g[f])


@kernel
def _set_current(tree, poses, joints, curvature, added) -> None:  # type: ignore[no-untyped-def]
    for f in range(added.shape[0]):
        set_current(tree, pose_of(poses, f), _blocks_of(joints, f), _curvature_of(curvature, f))
    added[:] = 0.0


@kernel
def _update(  # type: ignore[no-untyped-def]
    tree, poses, d, trial, joints, accepted, curvature
) -> None:
    parts = tree.parents.shape[0]
    for f in range(d.shape[0]):
        u = d[f, 3 : 3 + 3 * parts].reshape(parts, 3)  # row 0 is the root's position
        blocks = _blocks_of(joints, f)
        update(
            tree,
            pose_of(poses, f),
            u,
            pose_of(trial, f),
            blocks,
            accepted,
            _curvature_of(curvature, f),
        )


@kernel
def _apply(tree, poses, curvature, share, added, system) -> None:  # type: ignore[no-untyped-def]
    """Add share times what may be added of S to the diagonal blocks, instead of `added` (T, K+1,
    6), their triangle.
    """
    for f in range(added.shape[0]):
        D = system.D[f]
        for i in range(1, added.shape[1]):
            part = allowed_part(curvature.H[f, i], curvature.S[f, i], share)
            S = turned(entries(poses.R[f, tree.parents[i]]), part)
            at = 3 + 3 * i
            k = 0
            for r in range(3):
                for c in range(r, 3):
                    D[at + r, at + c] += S[k] - added[f, i, k]
                    added[f, i, k] = S[k]
                    k += 1


@kernel
def retract_clip(tree, poses, d, dg, trial) -> None:  # type: ignore[no-untyped-def]
    """Write the poses moved by d (T, n) and dg to `trial`: see `move`."""
    parts = tree.parents.shape[0]
    for f in range(d.shape[0]):
        u = d[f, 3 : 3 + 3 * parts].reshape(parts, 3)  # row 0 is the root's position
        move(tree, pose_of(poses, f), d[f], u, dg, pose_of(trial, f))


class Optimizer(SeveralFrames):
    """Optimizes one clip; `poses`, `system` and `costs` are those of the best point so far."""

    def __init__(self, problem: ClipProblem, poses: Pose, pool: ThreadPoolExecutor | None) -> None:
        """Allocate two systems, of which the trial point's becomes the current one when it is
        accepted.
        """
        super().__init__()
        self.problem = problem
        self.settings = problem.settings
        self.pool = pool
        self.poses = poses
        self._trial = make_poses(problem.tree, problem.frames)
        self.system = problem.make_system()
        self._other = problem.make_system()
        self.factor = make_factor(self.system)
        self.costs = dict[str, float]()
        shape = problem.frames, len(problem.tree.parents)
        S, H = np.zeros((2, *shape, 6))
        self._curvature = Curvature(S, H, np.zeros((*shape, 3)))
        self._added = np.zeros((*shape, 6))

    def _begin(self, s: int) -> float:
        cost = self.problem.linearize(s, self.poses, self.system)
        self.costs = self.problem.costs
        self._curvature.S[:] = 0.0
        self._set_current()
        return cost

    def _set_current(self) -> None:
        """Take over the joints' own Hessians and gradients at the current poses."""
        if self.settings.curvature:
            joints = self.problem.joints
            _set_current(self.problem.tree, self.poses, joints, self._curvature, self._added)

    def _apply(self, share: float) -> None:
        """Add that share of what may be added of S to the current system, instead of what was."""
        if self.settings.curvature:
            tree = self.problem.tree
            _apply(tree, self.poses, self._curvature, share, self._added, self.system)

    def _step(self, s: int, damping: float) -> float:
        self._apply(1.0)
        root_scale = self.settings.root_scale
        return solve_clip(
            self.problem.tree, self.system, damping, root_scale, self.factor, self.pool
        )

    def _try(self, s: int) -> float:
        retract_clip(self.problem.tree, self.poses, self.factor.d, self.factor.dg, self._trial)
        return self.problem.linearize(s, self._trial, self._other)

    def _conclude(self, s: int, cost: float, accepted: bool) -> None:
        if self.settings.curvature and np.isfinite(cost):
            problem = self.problem
            step = self.factor.d
            _update(
                problem.tree, self.poses, step, self._trial, problem.joints, accepted,
                self._curvature,
            )  # fmt: skip
        if accepted:
            self.costs = self.problem.costs
            self.poses, self._trial = self._trial, self.poses
            self.system, self._other = self._other, self.system
            self._set_current()

    def _end(self) -> None:
        self._apply(0.0)

    def information(self) -> Array:
        """Return the information (G, G) of the global columns with all poses eliminated, priors
        included.
        """
        G = self.problem.tree.global_count
        root_scale = self.settings.root_scale
        eliminate_clip(self.system, MIN_DAMPING, root_scale, self.factor, self.pool)
        C = np.triu(self.factor.C[:G, :G])
        information: Array = C + np.triu(C, 1).T
        return information
