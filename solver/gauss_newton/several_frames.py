# SPDX-License-Identifier: GPL-3.0-or-later
"""What the fits of several frames have in common: the loop of steps and trials, and the priors of
shared unknowns.
"""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from ..compiled.part import Array
from .optimizer import (
    CONVERGED,
    FIRST_GROWTH,
    MAX_ITERATIONS,
    MIN_DECREASE,
    NON_FINITE,
    RUNNING,
    Settings,
    judge_trial,
)


class SharedPriors(NamedTuple):
    """Priors of the shape and of the logarithm of the focal length, which count once for all
    frames.
    """

    shape_mean: Array  # (P,)
    shape_information: Array  # (P, P), over the shape's weight
    focal_weight: float

    def costs(self, weight: float, beta: Array, log_focal: float, focal: bool) -> dict[str, float]:
        """Return the cost of each at beta (W,), with a weight of the shape's prior; `focal`: the
        length is unknown.
        """
        offset = beta[: len(self.shape_mean)] - self.shape_mean
        shape = {"shape_prior": float(0.5 * weight * (offset @ self.shape_information @ offset))}
        return shape | {"focal_prior": 0.5 * self.focal_weight * log_focal**2} if focal else shape

    def add(
        self, weight: float, beta: Array, log_focal: float, focal: bool, system: tuple[Array, Array]
    ) -> None:
        """Add their Hessian and gradient to C (W, W) and c (W,) of `system`."""
        (C, c) = system
        P = len(self.shape_mean)
        C[:P, :P] += weight * self.shape_information
        c[:P] += weight * (self.shape_information @ (beta[:P] - self.shape_mean))
        if focal:
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
