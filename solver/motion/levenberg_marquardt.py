# SPDX-License-Identifier: GPL-3.0-or-later
"""Levenberg-Marquardt over all poses of a clip and what they share."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..compiled.kernel import kernel
from ..compiled.part import Array, Pose
from ..gauss_newton.optimizer import MIN_DAMPING
from ..gauss_newton.recursion import move
from ..gauss_newton.several_frames import SeveralFrames
from .band import eliminate_clip, make_factor, solve_clip
from .curvature import ClipCurvature
from .problem import ClipProblem
from .system import make_poses, pose_of


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
