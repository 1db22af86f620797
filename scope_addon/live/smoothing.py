# SPDX-License-Identifier: GPL-3.0-or-later
"""Causal smoothing of a pose: its rotations, and the direction and distance of its pelvis."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .low_pass import Response, RotationFilter, VectorFilter

DELAY_S = 0.06  # of every pose, whatever the frame rate: later frames separate noise from motion
MOTION = Response.delayed(stages=6, cutoff_hz=5.5, delay_s=DELAY_S)
# its logarithm: noisier than the direction
DISTANCE = Response.delayed(stages=5, cutoff_hz=3.5, delay_s=DELAY_S)


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
        rotations: NDArray[np.floating[Any]],
        root_cam: NDArray[np.floating[Any]],
        time_s: float,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
