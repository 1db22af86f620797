# SPDX-License-Identifier: GPL-3.0-or-later
"""What the networks find in a clip that is played there and back, for as many frames as are wanted.

The networks look at two rounds. Every later round repeats the second one, which begins as each of
them does: with the person being followed. A day of footage then takes no more of the networks' time
than twenty seconds.
"""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.perception.observation import Observation
from ...scope_addon.capture.tracking.tracker import PeopleTracker

Found = list[tuple[int, Observation]]


def there_and_back(count: int) -> list[int]:
    """Return the frame numbers of one round of a clip of ``count`` frames, whose end leads to its
    beginning.
    """
    return [*range(count), *range(count - 2, 0, -1)]


class Observing:
    """A tracker that keeps what it has found; answers of the reference network are waited for."""

    def __init__(self, quality: str, threads: int) -> None:
        self._tracker = PeopleTracker(quality, threads)
        self.found: list[Found] = []

    def step(
        self, image_rgb: NDArray[np.uint8], upcoming_rgb: None = None, time_s: float | None = None
    ) -> Found:
        """See `PeopleTracker.step`."""
        found = self._tracker.step(image_rgb, upcoming_rgb, time_s)
        self.found.append([(tracklet, _answered(observation)) for tracklet, observation in found])
        return self.found[-1]


class Repeating:
    """A tracker that finds what another one has found, round after round.

    :param found: of two rounds, frame by frame.
    """

    def __init__(self, found: list[Found]) -> None:
        self._found = found
        self._next = 0

    def seek(self, frame: int) -> None:
        """Continue with this frame, counted from the beginning of the first round: those before it
        were dropped.
        """
        self._next = frame

    def step(self, *_: Any) -> Found:
        """See `PeopleTracker.step`."""
        k = self._next
        per_round = len(self._found) // 2
        self._next += 1
        return self._found[k] if k < per_round else self._found[per_round + k % per_round]


def _answered(observation: Observation) -> Observation:
    """Return the observation with the reference network's answer."""
    if observation.reference_landmarks is None:
        return observation
    answer: Future[NDArray[np.float64] | None] = Future()
    answer.set_result(observation.reference_landmarks.result())
    return replace(observation, reference_landmarks=answer)
