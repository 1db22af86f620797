# SPDX-License-Identifier: GPL-3.0-or-later
"""Where soles and palms rest: one place for as long as they do.

Where little speed is allowed, a point can still drift by centimetres in some seconds. One that has stayed within
`SPREAD_M` of its mean throughout a rest is therefore drawn to that mean; one that has strayed farther may not rest.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....kinematics.runs import runs

MIN_PROBABILITY = 0.5
SPREAD_M = 0.02


def resting_places(
    points: NDArray[np.floating[Any]], resting: NDArray[np.floating[Any]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the places (T, C, 3) of points while they rest, and the probability (T, C) that they are there.

    :param points: (T, C, 3) in axes that do not move, metres.
    :param resting: (T, C) probability that each point rests.
    """
    places, probability = np.zeros(points.shape), np.zeros(resting.shape)
    for c in range(resting.shape[1]):
        for first, end in runs(resting[:, c] > MIN_PROBABILITY):
            rest, p = points[first:end, c], resting[first:end, c]
            place = p @ rest / p.sum()
            if np.linalg.norm(rest - place, axis=1).max() < SPREAD_M:
                places[first:end, c], probability[first:end, c] = place, p
    return places, probability
