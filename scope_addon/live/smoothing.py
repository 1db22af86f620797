# SPDX-License-Identifier: GPL-3.0-or-later
"""Causal smoothing of a pose: its rotations, and the direction and distance of its pelvis.

The filters are causal low-pass filters that make up for most of their own delay: n first-order
filters in a row, x̂ += a (x − x̂) with a = 1 / (1 + 1 / (2π f dt)) and the time step dt, suppress
noise with the n-th power of its frequency, and delay steady motion by n / (2π f), whatever the
frame rate. The result is moved on by its own velocity times a lead, which takes that much of the
delay away. Rotations take the fraction a of the rotation from R̂ to R.

On fits of four clips at 60 frames/s and one at 30, compared with the offline motion, the delay
decides: six filters of 5.5 Hz with a delay of 60 ms have two thirds of the jitter of six of 7 Hz
with 33 ms, and deviate as much. The best response of any form and of the same delay (fitted to
three of the clips) has an eighth less jitter on the fourth. Cutoff frequencies that fall with speed
add jitter of their own, and deviate more. A Kalman filter of constant velocity or acceleration with
the same delay jitters twice as much, because every innovation is a jump in its derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.rotations import exp, log, nearest_rotation
from ..arrays import Float64Array, FloatArray
from ..kinematics.smoothing import interpolate_rotations

DELAY_S = 0.06  # of every pose, whatever the frame rate: later frames separate noise from motion
LONGEST_STEP_S = 0.5  # after a longer pause, a filter starts again
# after the start, until when the velocity is not yet known; the lead grows during this time
LEAD_FROM_S = 0.4


@dataclass(frozen=True)
class Response:
    """How a filter responds: n, f and the lead of the module's equations."""

    stages: int
    cutoff_hz: float
    lead_s: float = 0.0

    @classmethod
    def delayed(cls, stages: int, cutoff_hz: float) -> Response:
        """Return the response that delays steady motion by `DELAY_S`."""
        return cls(stages, cutoff_hz, stages / (2 * np.pi * cutoff_hz) - DELAY_S)

    def lead(self, age_s: float) -> float:
        """Return the lead at a time after the start."""
        share = min(age_s / LEAD_FROM_S, 1.0)
        return self.lead_s * share * share * (3 - 2 * share)

    def share(self, step_s: float) -> float:
        """Return a for a time step."""
        return float(1.0 / (1.0 + 1.0 / (2 * np.pi * self.cutoff_hz * step_s)))


MOTION = Response.delayed(stages=6, cutoff_hz=5.5)
# its logarithm: noisier than the direction
DISTANCE = Response.delayed(stages=5, cutoff_hz=3.5)


class VectorFilter:
    """Filters vectors (n,)."""

    def __init__(self, response: Response) -> None:
        self._response = response
        self.reset()

    def reset(self) -> None:
        """Start again with the next value."""
        self._values: list[Float64Array] = []

    def __call__(self, value: FloatArray, step_s: float) -> Float64Array:
        """Return the filtered value (...).

        :param value: (...), of the kind that the filter is for.
        :param step_s: seconds since the value before.
        """
        x: Float64Array = np.array(value, float)
        if not self._values or not 0.0 < step_s <= LONGEST_STEP_S:
            self._values = [x] * self._response.stages
            self._age_s = 0.0
            return x
        self._age_s += step_s
        share = self._response.share(step_s)
        before = self._values[-1]
        for k, state in enumerate(self._values):
            self._values[k] = x = self._between(state, x, share)
        return self._beyond(before, x, self._response.lead(self._age_s) / step_s)

    def _between(self, a: Float64Array, b: Float64Array, share: float) -> Float64Array:
        """Return what lies between a and b, at a share of the way."""
        return a + share * (b - a)

    def _beyond(self, a: Float64Array, b: Float64Array, lead: float) -> Float64Array:
        """Return what lies beyond b, by a multiple of the way from a."""
        return b + lead * (b - a)


class RotationFilter(VectorFilter):
    """Filters rotations (J, 3, 3), each for itself."""

    def _between(self, a: Float64Array, b: Float64Array, share: float) -> Float64Array:
        # without what rounding has added up
        return nearest_rotation(interpolate_rotations(a, b, share))

    def _beyond(self, a: Float64Array, b: Float64Array, lead: float) -> Float64Array:
        return b @ exp(lead * log(np.swapaxes(a, 1, 2) @ b))


class PoseFilter:
    """Filters poses in the order of their frames; distance and direction separately, as offline."""

    def __init__(self) -> None:
        self._rotations = RotationFilter(MOTION)
        self._direction = VectorFilter(MOTION)
        self._distance = VectorFilter(DISTANCE)
        self._last_s = -np.inf

    def reset(self) -> None:
        """Start again with the next pose."""
        for each in (self._rotations, self._direction, self._distance):
            each.reset()

    def __call__(
        self,
        rotations: FloatArray,
        root_cam: FloatArray,
        time_s: float,
    ) -> tuple[Float64Array, Float64Array]:
        """Return filtered rotations (K+1, 3, 3) and pelvis (3,).

        :param rotations: (K+1, 3, 3).
        :param root_cam: (3,) camera frame, metres.
        """
        step_s = time_s - self._last_s
        self._last_s = time_s
        distance = max(float(np.linalg.norm(root_cam)), 1e-6)
        ray = self._direction(root_cam / distance, step_s)
        log_distance = self._distance(np.array([np.log(distance)]), step_s)
        return self._rotations(rotations, step_s), ray / np.linalg.norm(ray) * np.exp(
            log_distance[0]
        )
