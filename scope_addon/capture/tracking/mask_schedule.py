# SPDX-License-Identifier: GPL-3.0-or-later
"""Person masks of everybody in a few frames of the clip, from which the shape is estimated
later.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...arrays import Uint8Array
from ..perception.landmark_network import LandmarkNetwork
from ..perception.observation import Observation, PersonMask

MASKS = 16  # for a clip, about; 8 give the same shape on real clips
MIN_STRIDE = 6  # frames between two masks in short clips
MIN_PRESENCE = 0.5  # in a region without a person, the network invents one


class MaskSchedule:
    """Adds masks to the observations of every n-th frame.

    When there are enough, n doubles: a clip of unknown length has hardly more masks than one of
    known length. The tracker knows beforehand which frame is due (`upcoming_is_due`), since its own
    run of the network gives masks at a quarter of the cost of another one; only people whom it was
    not following take that other run.

    :param network: None: no frame has masks.
    :param frames: how many frames are expected; 0 if that is unknown.
    """

    def __init__(self, network: LandmarkNetwork | None, frames: int) -> None:
        self._network = network
        self._stride = max(MIN_STRIDE, frames // MASKS)
        self._frames = 0
        self._masks = 0

    @property
    def upcoming_is_due(self) -> bool:
        """Whether the frame after the next one to be added will be due, if people are seen in the
        next one.
        """
        return self._network is not None and (self._frames + 1) % self._stride == 0

    def add(
        self, image_rgb: Uint8Array, observations: Sequence[tuple[int, Observation]]
    ) -> list[tuple[int, Observation]]:
        """Return the observations of the next frame (H, W, 3) with masks, if they are due."""
        found = list(observations)
        due = self._frames % self._stride == 0
        self._frames += bool(found)
        if self._network is None or not found or not due:
            return [(number, o if o.mask is None else replace(o, mask=None)) for number, o in found]
        self._masks += 1
        if self._masks % MASKS == 0:
            self._stride *= 2
        return [(number, self._with_mask(self._network, image_rgb, o)) for number, o in found]

    @staticmethod
    def _with_mask(
        network: LandmarkNetwork, image_rgb: Uint8Array, observation: Observation
    ) -> Observation:
        if observation.presence < MIN_PRESENCE:
            return replace(observation, mask=None)
        if observation.mask is not None:
            return observation
        probability = network.mask(image_rgb, observation.region).astype(np.float16)
        size = image_rgb.shape[1], image_rgb.shape[0]
        return replace(observation, mask=PersonMask(observation.region, probability, size))
