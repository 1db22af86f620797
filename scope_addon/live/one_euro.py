# SPDX-License-Identifier: GPL-3.0-or-later
"""Causal low-pass filters whose cut-off frequency grows with the speed: little jitter at rest, little delay in motion.

With the time step dt, the filter x̂ += a (x − x̂) has a = 1 / (1 + 1 / (2π f dt)), where f = f_min + b |v̂| and v̂ is the
speed, low-pass filtered at `SPEED_CUTOFF_HZ`. Rotations take the fraction a of the rotation from R̂ to R, and the speed
is the angular one.

Source: Casiez, Roussel and Vogel 2012 (the 1€ filter).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver import rotations

SPEED_CUTOFF_HZ = 1.0
LONGEST_STEP_S = 0.5  # after a longer pause, a filter starts again


def share(cutoff_hz: NDArray[np.floating[Any]] | float, step_s: float) -> NDArray[np.floating[Any]]:
    """Return a (...) of the module's equation."""
    return np.asarray(1.0 / (1.0 + 1.0 / (2 * np.pi * np.maximum(cutoff_hz, 1e-6) * step_s)))


class OneEuro:
    """Filters vectors (n,), all with the same cut-off frequency.

    :param min_cutoff_hz: f_min.
    :param speed_gain: b in Hz per unit of speed.
    """

    def __init__(self, min_cutoff_hz: float, speed_gain: float) -> None:
        self._min_cutoff_hz, self._speed_gain = min_cutoff_hz, speed_gain
        self._value: NDArray[np.float64] | None = None
        self._velocity: NDArray[np.float64] = np.zeros(0)

    def reset(self) -> None:
        """Start again with the next value."""
        self._value = None

    def __call__(self, value: NDArray[np.floating[Any]], step_s: float) -> NDArray[np.float64]:
        """Return the filtered value (n,).

        :param value: (n,).
        :param step_s: seconds since the value before.
        """
        if self._value is None or not 0.0 < step_s <= LONGEST_STEP_S:
            self._value, self._velocity = np.array(value, float), np.zeros(len(value))
            return self._value
        change = value - self._value
        self._velocity = self._velocity + share(SPEED_CUTOFF_HZ, step_s) * (change / step_s - self._velocity)
        cutoff_hz = self._min_cutoff_hz + self._speed_gain * float(np.linalg.norm(self._velocity))
        self._value = self._value + share(cutoff_hz, step_s) * change
        return self._value


class RotationOneEuro:
    """Filters rotations (J, 3, 3), each with a cut-off frequency of its own.

    :param min_cutoff_hz: f_min.
    :param speed_gain: b in Hz per rad/s.
    """

    def __init__(self, min_cutoff_hz: float, speed_gain: float) -> None:
        self._min_cutoff_hz, self._speed_gain = min_cutoff_hz, speed_gain
        self._value: NDArray[np.float64] | None = None
        self._velocity: NDArray[np.float64] = np.zeros((0, 3))

    def reset(self) -> None:
        """Start again with the next rotations."""
        self._value = None

    def __call__(self, R: NDArray[np.floating[Any]], step_s: float) -> NDArray[np.float64]:
        """Return the filtered rotations (J, 3, 3).

        :param R: (J, 3, 3).
        :param step_s: seconds since the rotations before.
        """
        if self._value is None or not 0.0 < step_s <= LONGEST_STEP_S:
            self._value, self._velocity = np.array(R, float), np.zeros((len(R), 3))
            return self._value
        change = rotations.log(np.swapaxes(self._value, 1, 2) @ R)
        self._velocity = self._velocity + share(SPEED_CUTOFF_HZ, step_s) * (change / step_s - self._velocity)
        cutoff_hz = self._min_cutoff_hz + self._speed_gain * np.linalg.norm(self._velocity, axis=1)
        self._value = rotations.nearest_rotation(
            self._value @ rotations.exp(share(cutoff_hz, step_s)[:, None] * change)
        )
        return self._value
