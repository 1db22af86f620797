# SPDX-License-Identifier: Apache-2.0
"""Levenberg-Marquardt: the control that every fit shares, the compiled optimizer of one frame, and
the loop over several frames.

A trial point is accepted if it lowers the cost. The damping follows the gain ratio, the actual
decrease over the predicted one (`judge_trial`), and a stage ends when the decrease, predicted or
actual, becomes negligible. Of one frame, every trial point is linearized in the pass that evaluates
it, so an accepted step costs one pass and one solve; a rejected one leaves the kept blocks to be
solved again with a larger damping (two sets of blocks, swapped on acceptance). Rejected or not, a
trial updates the estimate of what Gauss-Newton leaves out of the joints' Hessians (curvature.py).
Source: damping by the gain ratio after Nielsen, Damping Parameter in Marquardt's Method,
IMM-REP-1999-05.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..kernel import inlined_kernel, kernel
from ..options import Options, Stage
from ..part import Array, Blocks, Pose
from .curvature import Curvature, apply_correction, reset, set_current, update
from .linearize import linearize
from .recursion import Workspace, eliminate, retract, step

MIN_DAMPING = 1e-9
MAX_DAMPING = 1e12
# of the damping after the first rejected step; it doubles with every further one in a row
FIRST_GROWTH = 2.0
MIN_DECREASE = 1e-13  # a predicted decrease below this share of the cost is rounding
RUNNING = -1  # not a `Status`: the stage goes on
CONVERGED, MAX_ITERATIONS, STALLED, NO_MEASUREMENTS, NON_FINITE = range(5)  # values of `Status`


class Settings(NamedTuple):
    """`Options` for `optimize`; S stages."""

    stages: Array  # (S, 2, weights): weights and 1/sigma in the registry's order
    tolerances: Array  # (S,) relative decrease at which a stage ends
    limits: Array  # (S,) iterations
    damping: float  # at the start of each stage
    root_scale: float  # radians per metre of the pelvis's motion
    curvature: bool  # whether curvature.py takes part


def make_settings(options: Options, stages: Sequence[Stage]) -> Settings:
    """Return the settings of a fit through these stages.

    :raises ShapeError: when a weight, a robust scale or a tolerance cannot be used.
    """
    table = options.stage_table(stages)
    damping = float(options.damping)
    root_scale = 1.0 / options.root_length
    return Settings(*table, damping, root_scale, bool(options.curvature))


class Memory(NamedTuple):
    """The working memory of `optimize`; the first pose is where it starts."""

    poses: tuple[Pose, Pose]
    blocks: tuple[Blocks, Blocks]
    curvature: Curvature
    work: Workspace


def judge_trial(
    cost: float,
    trial_cost: float,
    predicted: float,
    damping: float,
    growth: float,
    tolerance: float,
) -> tuple[bool, float, float, int]:
    """Return (whether to accept a trial point, the next damping, its next growth, CONVERGED,
    STALLED or RUNNING).

    With the gain ratio g = (cost - trial_cost) / predicted, an accepted step multiplies the damping
    by max(1/9, 1 - (2 g - 1)^3), a rejected one by `growth`, which then doubles. A trial cost that
    is not a number is rejected. CONVERGED: the decrease is at most `tolerance` times the cost.
    STALLED: the damping exceeds its limit.
    """
    if trial_cost < cost:  # False for NaN
        decrease = cost - trial_cost
        gain = 2.0 * decrease / predicted - 1.0
        damping = min(max(damping * max(1.0 / 9.0, 1.0 - gain**3), MIN_DAMPING), MAX_DAMPING)
        return True, damping, FIRST_GROWTH, CONVERGED if decrease <= tolerance * cost else RUNNING
    damping *= growth
    return False, damping, 2.0 * growth, STALLED if damping > MAX_DAMPING else RUNNING


# For `optimize`; `SeveralFrames`, whose loop is not compiled, calls it as it is.
_judge_trial = kernel(judge_trial)


@inlined_kernel
def _run_stage(tree, terms, s, settings, memory, start):  # type: ignore[no-untyped-def]
    """Run stage s from memory.poses[start]; return (cost, status, iterations, how many rejected,
    index of the result).

    The blocks of the result have the same index.
    """
    stage = settings.stages[s]
    tolerance = settings.tolerances[s]
    curvature = memory.curvature
    work = memory.work
    at = start
    damping = settings.damping
    growth = FIRST_GROWTH
    iterations = 0
    rejected = 0
    pose = memory.poses[start]
    blocks = memory.blocks[start]
    trial = memory.poses[1 - start]
    trial_blocks = memory.blocks[1 - start]
    cost = linearize(tree, terms, stage, pose, blocks, work.scratch)
    if not np.isfinite(cost):
        return cost, NON_FINITE, iterations, rejected, at
    if settings.curvature:
        reset(curvature)
        set_current(tree, pose, blocks, curvature)
    status = MAX_ITERATIONS
    for _ in range(settings.limits[s]):
        if settings.curvature:
            apply_correction(tree, pose, blocks, curvature, 1.0)
        predicted = step(tree, pose, blocks, damping, settings.root_scale, work)
        if predicted <= MIN_DECREASE * cost:
            status = CONVERGED
            break
        iterations += 1
        trial_cost = np.inf
        if np.isfinite(predicted):
            retract(tree, pose, work, trial)
            trial_cost = linearize(tree, terms, stage, trial, trial_blocks, work.scratch)
        accepted, damping, growth, verdict = _judge_trial(
            cost, trial_cost, predicted, damping, growth, tolerance
        )
        if settings.curvature and np.isfinite(trial_cost):
            update(tree, pose, work.u, trial, trial_blocks, accepted, curvature)
        if accepted:
            cost = trial_cost
            at = 1 - at
            pose, trial = trial, pose
            blocks, trial_blocks = trial_blocks, blocks
            if settings.curvature:
                set_current(tree, pose, blocks, curvature)
        else:
            rejected += 1
        if verdict != RUNNING:
            status = verdict
            break
    if settings.curvature:
        apply_correction(tree, pose, blocks, curvature, 0.0)
    return cost, status, iterations, rejected, at


@kernel
def optimize(tree, terms, measured, settings, memory):  # type: ignore[no-untyped-def]
    """Run all stages from memory.poses[0]; return (cost, status, iterations, how many rejected,
    index of the result).

    Without measurements, or for a cost that is not finite, the pose stays where it is. At the end
    memory.work.C is the reduced Gauss-Newton system of the result: see `eliminate`.
    """
    # Not the constant 0, for which `_run_stage` would be compiled once more.
    work = memory.work
    at = np.int64(0)
    iterations = 0
    rejected = 0
    if measured:
        cost = 0.0
        status = CONVERGED
        for s in range(settings.stages.shape[0]):
            cost, status, more, missed, at = _run_stage(tree, terms, s, settings, memory, at)
            iterations += more
            rejected += missed
            if status == NON_FINITE:
                break
    else:
        status = NO_MEASUREMENTS
        cost = linearize(
            tree,
            terms,
            settings.stages[-1],
            memory.poses[0],
            memory.blocks[0],
            work.scratch,
        )
    eliminate(tree, memory.poses[at], memory.blocks[at], MIN_DAMPING, settings.root_scale, work)
    return cost, status, iterations, rejected, at


class SharedPriors(NamedTuple):
    """Priors of the shape and of the logarithm of the focal length, which count once for all
    frames.
    """

    shape_mean: Array  # (P,)
    shape_information: Array  # (P, P), over the shape's weight
    focal_weight: float | None  # None: the length is known

    def costs(self, weight: float, beta: Array, log_focal: float) -> dict[str, float]:
        """Return the cost of each at beta (W,), with a weight of the shape's prior."""
        offset = beta[: len(self.shape_mean)] - self.shape_mean
        costs = {"shape_prior": float(0.5 * weight * (offset @ self.shape_information @ offset))}
        if self.focal_weight is not None:
            costs["focal_prior"] = 0.5 * self.focal_weight * log_focal**2
        return costs

    def add(self, weight: float, beta: Array, log_focal: float, C: Array, c: Array) -> None:
        """Add their Hessian and gradient to C (W, W) and c (W,)."""
        P = len(self.shape_mean)
        C[:P, :P] += weight * self.shape_information
        c[:P] += weight * (self.shape_information @ (beta[:P] - self.shape_mean))
        if self.focal_weight is not None:
            C[P, P] += self.focal_weight
            c[P] += self.focal_weight * log_focal


class SeveralFrames(ABC):
    """Levenberg-Marquardt over several frames, with the control of a single frame's fit."""

    settings: Settings

    def __init__(self) -> None:
        self.cost = 0.0
        self.iterations = 0
        self.rejected = 0

    def run(self) -> int:
        """Optimize through all stages and return the last one's status."""
        status = CONVERGED
        for s in range(len(self.settings.stages)):
            status = self._run_stage(s)
            if status == NON_FINITE:
                break
        return status

    def _run_stage(self, s: int) -> int:
        settings = self.settings
        damping = settings.damping
        growth = FIRST_GROWTH
        status = MAX_ITERATIONS
        self.cost = self._begin(s)
        if not np.isfinite(self.cost):
            return NON_FINITE
        for _ in range(settings.limits[s]):
            predicted = self._step(s, damping)
            if predicted <= MIN_DECREASE * self.cost:
                status = CONVERGED
                break
            self.iterations += 1
            cost = self._try(s) if np.isfinite(predicted) else np.inf
            accepted, damping, growth, verdict = judge_trial(
                self.cost, cost, predicted, damping, growth, settings.tolerances[s]
            )
            self._conclude(s, cost, accepted)
            if accepted:
                self.cost = cost
            else:
                self.rejected += 1
            if verdict != RUNNING:
                status = verdict
                break
        self._end()
        return status

    @abstractmethod
    def _begin(self, s: int) -> float:
        """Linearize with the weights of stage s where it begins, and return the cost."""

    @abstractmethod
    def _step(self, s: int, damping: float) -> float:
        """Solve for a step, and return the decrease that it predicts."""

    @abstractmethod
    def _try(self, s: int) -> float:
        """Linearize at the trial point of the last step, and return the cost."""

    @abstractmethod
    def _conclude(self, s: int, cost: float, accepted: bool) -> None:
        """Make the trial point, whose cost this is, the current one if it was accepted, and else
        stay.
        """

    def _end(self) -> None:  # noqa: B027 - not all have something to do
        """Finish a stage that has begun."""
