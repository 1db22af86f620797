# SPDX-License-Identifier: Apache-2.0
"""Levenberg-Marquardt over all poses of a clip and what they share.

What Gauss-Newton leaves out of the joints' Hessians is learned over the clip, as
gauss_newton/curvature.py does in a frame.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba.extending import register_jitable

from ..gauss_newton.curvature import Curvature, allowed_share, set_current, turned, update, upper
from ..gauss_newton.optimizer import MIN_DAMPING, SeveralFrames
from ..gauss_newton.recursion import move
from ..kernel import kernel
from ..part import Array, Blocks, Pose
from ..tree import Tree
from .band import eliminate_clip, make_factor, solve_clip
from .problem import ClipProblem
from .system import ClipSystem, make_poses, pose_of


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
            S = upper(curvature.S[f, i])
            t = share * allowed_share(curvature.H[f, i], curvature.S[f, i]) if share > 0.0 else 0.0
            if t > 0.0:  # False if S has overflowed
                S = turned(poses.R[f, tree.parents[i]], S, True)
            else:
                t = 0.0
                S = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            at = 3 + 3 * i
            k = 0
            for r in range(3):
                for c in range(r, 3):
                    D[at + r, at + c] += t * S[k] - added[f, i, k]
                    added[f, i, k] = t * S[k]
                    k += 1


class ClipCurvature:
    """The estimate at the current poses of T frames."""

    def __init__(self, tree: Tree, frames: int, on: bool) -> None:
        """Begin with nothing; if it is not `on`, it stays at that."""
        self._tree = tree
        self._on = on
        parts = len(tree.parents)
        S, H = np.zeros((2, frames, parts, 3, 3))
        self._curvature = Curvature(S, H, np.zeros((frames, parts, 3)))
        self._added = np.zeros((frames, parts, 6))

    def set_current(self, poses: Pose, joints: Blocks) -> None:
        """Take over the joints' own Hessians and gradients at `poses`: blocks with a leading
        dimension of frames.
        """
        if self._on:
            _set_current(self._tree, poses, joints, self._curvature, self._added)

    def update(self, poses: Pose, d: Array, trial: Pose, joints: Blocks, accepted: bool) -> None:
        """Update by the step d (T, n) from the current poses to `trial`, which `joints` belong
        to.
        """
        if self._on:
            _update(self._tree, poses, d, trial, joints, accepted, self._curvature)

    def apply(self, poses: Pose, system: ClipSystem, wanted: bool = True) -> None:
        """Add what may be added of S to the system of the current poses, or take away what was
        added.
        """
        if self._on:
            _apply(self._tree, poses, self._curvature, float(wanted), self._added, system)


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

    def _begin(self, s: int) -> float:
        cost = self.problem.linearize(s, self.poses, self.system)
        self.costs = self.problem.costs
        self._learned = ClipCurvature(
            self.problem.tree, self.problem.frames, self.settings.curvature
        )
        self._learned.set_current(self.poses, self.problem.joints)
        return cost

    def _step(self, s: int, damping: float) -> float:
        self._learned.apply(self.poses, self.system)
        root_scale = self.settings.root_scale
        return solve_clip(
            self.problem.tree, self.system, damping, root_scale, self.factor, self.pool
        )

    def _try(self, s: int) -> float:
        retract_clip(self.problem.tree, self.poses, self.factor.d, self.factor.dg, self._trial)
        return self.problem.linearize(s, self._trial, self._other)

    def _conclude(self, s: int, cost: float, accepted: bool) -> None:
        joints = self.problem.joints
        if np.isfinite(cost):
            self._learned.update(self.poses, self.factor.d, self._trial, joints, accepted)
        if accepted:
            self.costs = self.problem.costs
            self.poses, self._trial = self._trial, self.poses
            self.system, self._other = self._other, self.system
            self._learned.set_current(self.poses, joints)

    def _end(self) -> None:
        self._learned.apply(self.poses, self.system, wanted=False)

    def information(self) -> Array:
        """Return the information (G, G) of the global columns with all poses eliminated, priors
        included.
        """
        G = self.problem.tree.globals
        root_scale = self.settings.root_scale
        eliminate_clip(self.system, MIN_DAMPING, root_scale, self.factor, self.pool)
        C = np.triu(self.factor.C[:G, :G])
        information: Array = C + np.triu(C, 1).T
        return information
