# SPDX-License-Identifier: GPL-3.0-or-later
"""What a body is known to stand on before its next frame is fitted: the floor, and the places where
points rest.

The size of a body in the picture does not tell a squat from a step back, but feet at rest do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import Floor, FootContacts, Measurements

# of the floor's weight; three times as much tilts bodies whose distance begins too far
AFTER_A_PAUSE = 0.01


@dataclass(frozen=True)
class Support:
    """Places in the camera frame, metres, and the plane of the floor, normal . p = offset."""

    places: NDArray[np.floating[Any]]  # (6, 3) where points rest
    rests: NDArray[np.floating[Any]]  # (6,) probability that each of them rests there
    on_floor: NDArray[np.floating[Any]]  # (6,) probability that it rests on the floor
    not_below: NDArray[np.floating[Any]]  # (6,) probability that it is not below the floor
    stands: float  # probability that the lowest sole was on the floor
    floor_normal: NDArray[np.floating[Any]]  # (3,) unit, upwards
    floor_offset: float

    def added_to(self, measurements: Measurements, points: NDArray[np.intp]) -> Measurements:
        """Return the measurements of a frame with this support.

        :param points: (6,) numbers of the contact points.
        """
        return replace(
            measurements,
            foot_contacts=FootContacts(points, self.places, self.rests),
            floor=Floor(
                points, self.floor_normal, self.floor_offset, self.on_floor, below=self.not_below
            ),
        )

    def after_a_pause(self) -> Support:
        """Return what is left of it when points may have moved since: who stood on the floor is not
        below it now.
        """
        nothing = np.zeros_like(self.rests)
        not_below = np.full_like(nothing, AFTER_A_PAUSE * self.stands)
        return replace(self, rests=nothing, on_floor=nothing, not_below=not_below)
