# SPDX-License-Identifier: GPL-3.0-or-later
"""Causal low-pass filters that make up for most of their own delay.

n first-order filters in a row, x̂ += a (x − x̂) with a = 1 / (1 + 1 / (2π f dt)) and the time step dt, suppress noise
with the n-th power of its frequency, and delay steady motion by n / (2π f), whatever the frame rate. The result is
moved on by its own velocity times a lead, which takes that much of the delay away. Rotations take the fraction a of
the rotation from R̂ to R.

On fits of four clips at 60 frames/s and one at 30, four filters of 6 Hz with a lead of 80 ms have a third to a quarter
of the jitter of a 1€ filter that deviates as much from the offline motion; pulling the solver towards the last frame's
state (`Temporal`) does as well as the 1€ filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver import rotations

LONGEST_STEP_S = 0.5  # after a longer pause, a filter starts again


@dataclass(frozen=True)
class Response:
    """How a filter responds: n, f and the lead of the module's equations."""

    stages: int
    cutoff_hz: float
    lead_s: float = 0.0

    def share(self, step_s: float) -> float:
        """Return a for a time step."""
        return float(1.0 / (1.0 + 1.0 / (2 * np.pi * self.cutoff_hz * step_s)))


class VectorFilter:
    """Filters vectors (n,)."""

    def __init__(self, response: Response) -> None:
        self._response = response
        self.reset()

    def reset(self) -> None:
        """Start again with the next value."""
        self._values: list[NDArray[np.float64]] = []

    def __call__(self, value: NDArray[np.floating[Any]], step_s: float) -> NDArray[np.float64]:
        """Return the filtered value (n,).

        :param value: (n,).
        :param step_s: seconds since the value before.
        """
        x = np.array(value, float)
        if not self._values or not 0.0 < step_s <= LONGEST_STEP_S:
            self._values = [x] * self._response.stages
            return x
        share, before = self._response.share(step_s), self._values[-1]
        for k, state in enumerate(self._values):
            self._values[k] = x = state + share * (x - state)
        moved: NDArray[np.float64] = x + self._response.lead_s / step_s * (x - before)
        return moved


class RotationFilter:
    """Filters rotations (J, 3, 3), each for itself."""

    def __init__(self, response: Response) -> None:
        self._response = response
        self.reset()

    def reset(self) -> None:
        """Start again with the next rotations."""
        self._values: list[NDArray[np.float64]] = []

    def __call__(self, R: NDArray[np.floating[Any]], step_s: float) -> NDArray[np.float64]:
        """Return the filtered rotations (J, 3, 3).

        :param R: (J, 3, 3).
        :param step_s: seconds since the rotations before.
        """
        x: NDArray[np.float64] = np.array(R, float)
        if not self._values or not 0.0 < step_s <= LONGEST_STEP_S:
            self._values = [x] * self._response.stages
            return x
        share, before = self._response.share(step_s), self._values[-1]
        for k, state in enumerate(self._values):
            self._values[k] = x = _nearest(state @ rotations.exp(share * _between(state, x)))
        moved: NDArray[np.float64] = x @ rotations.exp(self._response.lead_s / step_s * _between(before, x))
        return moved


def _nearest(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotations nearest to matrices (J, 3, 3), without what rounding has added up."""
    nearest: NDArray[np.float64] = rotations.nearest_rotation(matrices)
    return nearest


def _between(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation vectors (J, 3) from rotations a to b, in a's axes."""
    vectors: NDArray[np.float64] = rotations.log(np.swapaxes(a, 1, 2) @ b)
    return vectors
