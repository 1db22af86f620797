# SPDX-License-Identifier: GPL-3.0-or-later
"""Left-right swaps without looking ahead: the forward pass of the offline repair.

The cost of reading a frame as detected, swapped, or swapped with reversed depth is that of
`tracking/left_right`: how far the limbs move since the frame before, and how far they are from the
reference network's. The least cost of all readings up to a frame decides how it is read,

    C_t(x) = cost_t(x) + min_y (C_{t−1}(y) + d(w_{t−1}(y), w_t(x)) + change · [x ≠ y]).

The reference network answers some frames later, and its answer then counts in its own frame. Only
the frame in which a person is found waits for it, because nothing else distinguishes left from
right there.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import FloatArray
from ..capture.perception.observation import Observation, PendingReference
from ..capture.tracking.left_right import (
    AS_DETECTED,
    CHANGE_COST_M,
    LIMBS,
    MIRROR_PARTNER,
    apply_labels,
    mean_distance,
    reading_costs,
    readings_of,
)

_MAX_FRAMES = 120  # that are kept for an answer


@dataclass
class _Frame:
    """The readings of one frame, and what they cost."""

    readings: FloatArray  # (3, 12, 3)
    # (3, 3) of each reading (column) after each of the frame before (row)
    steps: FloatArray
    costs: FloatArray  # (3,) of each reading itself
    reference: PendingReference | None  # until its answer is added

    def add_reference(self, *, wait: bool) -> None:
        """Add the cost of the reference network's answer if it is there."""
        if self.reference is None or not (wait or self.reference.done()):
            return
        landmarks = self.reference.result()
        self.reference = None
        if landmarks is not None:
            self.costs = self.costs + mean_distance(self.readings, landmarks[LIMBS])


class CausalLeftRight:
    """Reads the observations of one person, in order.

    :param wait: for every answer of the reference network, so that results do not depend on the
        speed of threads.
    """

    def __init__(self, *, wait: bool = False) -> None:
        self._wait = wait
        self._frames: deque[_Frame] = deque()
        self._before = np.zeros(3)  # C of the frame before the first of these

    def __call__(self, observation: Observation) -> Observation:
        """Return the observation with left and right as they are."""
        if not observation.world_landmarks.any():  # without depth, only the whole clip decides
            return observation
        if observation.acquired:
            self._frames.clear()
        readings = readings_of(observation.world_landmarks[None])[:, 0]
        steps = np.zeros((3, 3))
        if self._frames:
            steps = mean_distance(self._frames[-1].readings[:, None], readings[None])
            steps = steps + CHANGE_COST_M * (1 - np.eye(3))
        self._frames.append(
            _Frame(readings, steps, reading_costs(), observation.reference_landmarks)
        )
        for frame in self._frames:
            frame.add_reference(wait=self._wait or observation.acquired)
        label = self._label()
        if label == AS_DETECTED:
            return observation
        return replace(
            observation,
            keypoints_px=observation.keypoints_px[MIRROR_PARTNER],
            keypoints_confidence=observation.keypoints_confidence[MIRROR_PARTNER],
            world_landmarks=apply_labels(observation.world_landmarks[None], np.array([label]))[0],
        )

    def _label(self) -> int:
        """Return the reading of the last frame, and forget frames that no answer can change any
        more.
        """
        totals = [self._before]
        for frame in self._frames:
            total = (totals[-1][:, None] + frame.steps).min(axis=0) + frame.costs
            totals.append(total - total.min())
        while len(self._frames) > 1 and (
            self._frames[0].reference is None or len(self._frames) > _MAX_FRAMES
        ):
            self._frames.popleft()
            totals.pop(0)
            self._before = totals[0]
        return int(totals[-1].argmin())
