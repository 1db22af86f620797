# SPDX-License-Identifier: GPL-3.0-or-later
"""Causal low-pass filters that make up for most of their own delay.

n first-order filters in a row, x̂ += a (x − x̂) with a = 1 / (1 + 1 / (2π f dt)) and the time step dt, suppress noise
with the n-th power of its frequency, and delay steady motion by n / (2π f), whatever the frame rate. The result is
moved on by its own velocity times a lead, which takes that much of the delay away. Rotations take the fraction a of
the rotation from R̂ to R.

On fits of four clips at 60 frames/s and one at 30, compared with the offline motion, the delay decides: six filters of
5.5 Hz with a delay of 60 ms have two thirds of the jitter of six of 7 Hz with 33 ms, and deviate as much. The best
response of any form and of the same delay (fitted to three of the clips) has an eighth less jitter on the fourth.
Cutoff frequencies that fall with speed add jitter of their own, and deviate more. A Kalman filter of constant velocity
or acceleration with the same delay jitters twice as much, because every innovation is a jump in its derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver import rotations

LONGEST_STEP_S = 0.5  # after a longer pause, a filter starts again
LEAD_FROM_S = 0.4  # after the start, until when the velocity is not yet known; the lead grows during this time


@dataclass(frozen=True)
class Response:
    """How a filter responds: n, f and the lead of the module's equations."""

    stages: int
    cutoff_hz: float
    lead_s: float = 0.0

    @classmethod
    def delayed(cls, stages: int, cutoff_hz: float, delay_s: float) -> Response:
        """Return the response that delays steady motion by a time."""
        return cls(stages, cutoff_hz, stages / (2 * np.pi * cutoff_hz) - delay_s)

    def lead(self, age_s: float) -> float:
        """Return the lead at a time after the start."""
        share = min(age_s / LEAD_FROM_S, 1.0)
        return self.lead_s * share * share * (3 - 2 * share)

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
            self._values, self._age_s = [x] * self._response.stages, 0.0
            return x
        self._age_s += step_s
        share, before = self._response.share(step_s), self._values[-1]
        for k, state in enumerate(self._values):
            self._values[k] = x = state + share * (x - state)
        moved: NDArray[np.float64] = x + self._response.lead(self._age_s) / step_s * (x - before)
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
            self._values, self._age_s = [x] * self._response.stages, 0.0
            return x
        self._age_s += step_s
        share, before, lead_s = self._response.share(step_s), self._values[-1], self._response.lead(self._age_s)
        for k, state in enumerate(self._values):
            self._values[k] = x = _nearest(state @ rotations.exp(share * _between(state, x)))
        return x @ rotations.exp(lead_s / step_s * _between(before, x))


def _nearest(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotations nearest to matrices (J, 3, 3), without what rounding has added up."""
    return rotations.nearest_rotation(matrices)


def _between(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation vectors (J, 3) from rotations a to b, in a's axes."""
    return rotations.log(np.swapaxes(a, 1, 2) @ b)
