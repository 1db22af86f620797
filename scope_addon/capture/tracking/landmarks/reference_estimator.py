# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference network: the largest landmark network, whose left and right are reliable, in a thread of its own."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ...perception.landmark_network import LandmarkNetwork
from ...perception.observation import PendingReference
from ...perception.region import Region
from .plausibility import is_plausible

MAX_PENDING = 2  # calls that are not finished, each of which keeps its frame in memory


class ReferenceEstimator:
    """Estimates world landmarks in the background; tracking does not depend on them, so it does not wait."""

    def __init__(self, network: LandmarkNetwork) -> None:
        self._network = network
        self._pending: list[PendingReference] = []
        self._pool = ThreadPoolExecutor(1, "scope-reference")

    def submit(self, image_rgb: NDArray[np.uint8], region: Region) -> PendingReference:
        """Start an estimate; wait first if too many are pending.

        :param image_rgb: (H, W, 3), not to be changed until the result is there.
        :return: world landmarks (33, 3) in metres, or None if they are not of a body.
        """
        self._pending = [call for call in self._pending if not call.done()]
        if len(self._pending) >= MAX_PENDING:
            self._pending[0].result()
        call: PendingReference = self._pool.submit(self._estimate, image_rgb, region)
        self._pending.append(call)
        return call

    def _estimate(self, image_rgb: NDArray[np.uint8], region: Region) -> NDArray[np.float64] | None:
        (estimate,) = self._network.estimate(image_rgb, [region])
        return estimate.world_landmarks if is_plausible(estimate) else None
