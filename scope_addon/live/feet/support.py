# SPDX-License-Identifier: GPL-3.0-or-later
"""What a body is known to stand on before its next frame is fitted: the floor, and the places where points rest.

The size of a body in the picture does not tell a squat from a step back, but feet at rest do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import Floor, FootContacts, Measurements


@dataclass(frozen=True)
class Support:
    """Places in the camera frame, metres, and the plane of the floor, normal . p = offset."""

    places: NDArray[np.floating[Any]]  # (6, 3) where points rest
    rests: NDArray[np.floating[Any]]  # (6,) probability that each of them rests there
    on_floor: NDArray[np.floating[Any]]  # (6,) probability that it rests on the floor
    floor_normal: NDArray[np.floating[Any]]  # (3,) unit, upwards
    floor_offset: float

    def added_to(self, measurements: Measurements, points: NDArray[np.intp]) -> Measurements:
        """Return the measurements of a frame with this support.

        :param points: (6,) numbers of the contact points.
        """
        return replace(
            measurements,
            foot_contacts=FootContacts(points, self.places, self.rests),
            # Points that are not in contact may be below the floor as well as above it, as on stairs.
            floor=Floor(points, self.floor_normal, self.floor_offset, self.on_floor, below=self.on_floor),
        )
