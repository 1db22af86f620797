# SPDX-License-Identifier: GPL-3.0-or-later
"""Levenberg-Marquardt over all poses of a clip and what they share, with the control of a single frame's fit."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..compiled.kernel import kernel
from ..compiled.part import Array, Pose
from ..gauss_newton.optimizer import (
    CONVERGED,
    DAMPING_LEAST,
    FIRST_GROWTH,
    LEAST_DECREASE,
    MAX_ITERATIONS,
    NON_FINITE,
    RUNNING,
    judge_trial,
)
from ..gauss_newton.recursion import move
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


class Optimizer:
    """Optimizes one clip; `poses`, `system` and `costs` are those of the best point so far."""

    def __init__(self, problem: ClipProblem, poses: Pose, pool: ThreadPoolExecutor | None) -> None:
        """Allocate two systems, of which the trial point's becomes the current one when it is accepted."""
        self.problem, self.pool = problem, pool
        frames = problem.frames
        self.poses, self._trial = poses, make_poses(problem.tree, frames)
        self.system, self._other = problem.make_system(), problem.make_system()
        self.factor = make_factor(self.system)
        self.cost, self.costs = 0.0, dict[str, float]()
        self.iterations, self.rejected = 0, 0

    def run(self) -> int:
        """Optimize through all stages and return the last one's status."""
        status = CONVERGED
        for s in range(len(self.problem.settings.stages)):
            status = self._run_stage(s)
            if status == NON_FINITE:
                break
        return status

    def _run_stage(self, s: int) -> int:
        settings, problem = self.problem.settings, self.problem
        verdict = RUNNING
        damping, growth, tolerance = settings.damping, FIRST_GROWTH, settings.tolerances[s]
        self.cost = problem.linearize(s, self.poses, self.system)
        self.costs = problem.costs
        if not np.isfinite(self.cost):
            return NON_FINITE
        learned = ClipCurvature(problem.tree, problem.frames, settings.curvature)
        learned.set_current(self.poses, problem.joints)
        for _ in range(settings.limits[s]):
            learned.apply(self.poses, self.system)
            predicted = solve_clip(problem.tree, self.system, damping, settings.root_scale, self.factor, self.pool)
            if predicted <= LEAST_DECREASE * self.cost:
                verdict = CONVERGED
                break
            self.iterations += 1
            cost = np.inf
            if np.isfinite(predicted):
                retract_clip(problem.tree, self.poses, self.factor.d, self.factor.dg, self._trial)
                cost = problem.linearize(s, self._trial, self._other)
            accepted, damping, growth, verdict = judge_trial(self.cost, cost, predicted, damping, growth, tolerance)
            if np.isfinite(cost):
                learned.update(self.poses, self.factor.d, self._trial, problem.joints, accepted)
            if accepted:
                self.cost, self.costs = cost, problem.costs
                self.poses, self._trial = self._trial, self.poses
                self.system, self._other = self._other, self.system
                learned.set_current(self.poses, problem.joints)
            else:
                self.rejected += 1
            if verdict != RUNNING:
                break
        learned.apply(self.poses, self.system, wanted=False)
        return MAX_ITERATIONS if verdict == RUNNING else verdict

    def information(self) -> Array:
        """Return the information (G, G) of the global columns with all poses eliminated, priors included."""
        G, root_scale = self.problem.tree.globals, self.problem.settings.root_scale
        eliminate_clip(self.system, DAMPING_LEAST, root_scale, self.factor, self.pool)
        C = np.triu(self.factor.C[:G, :G])
        information: Array = C + np.triu(C, 1).T
        return information
