# SPDX-License-Identifier: GPL-3.0-or-later
"""Somebody whom the tracker follows: where they are expected, and how they go behind something.

Who goes behind something is seen with less and less certainty, until the landmarks leap onto what hides them. From then
on the networks imagine a body there, for seconds at times, and believe in it.
"""

from __future__ import annotations

import math
from concurrent.futures import Future
from dataclasses import dataclass, field, replace

import numpy as np

from ..perception.landmark_network import PoseEstimate
from ..perception.region import Region

STARTLE = 0.08  # mean distance of the keypoints from where motion foretold them, in sides of the region
FALLEN = 0.8  # share of the confidence of late, below which it has fallen
LATE_S, LATE_FRAMES = 0.5, 5  # of late: so long, but so many frames at least
HIDING_PLACE = 0.5  # how far from where they are foretold, or were seen last, in sides of the region
SETTLED_FRAMES = 2  # after which the velocity says something
_VELOCITY_MEMORY = 0.7


@dataclass
class Followed:
    """Somebody who was seen in the last frame, or lost ``lost`` frames ago.

    ``seen_s`` is the time of the frame in which they were seen last; ``followed_s`` for how long they were seen so far,
    and on that clock are ``judged_s``, when the strong network looked, and ``clothes_s``, when their clothes were
    looked at.
    """

    tracklet: int
    estimate: PoseEstimate
    velocity_px: np.ndarray  # (2,) per frame, smoothed
    seen_s: float
    age: int = 0  # frames
    lost: int = 0
    followed_s: float = 0.0
    judged_s: float = -math.inf
    clothes_s: float = -math.inf
    swapped: bool = False  # whether left and right changed places since the strong network looked
    doubt_s: float = -math.inf  # the time since which the strong network stands in
    foreseen: Future[PoseEstimate] | None = None  # in the next frame, where it was expected
    confidences: list[tuple[float, float]] = field(default_factory=list)  # of late, each with its time
    is_hidden: bool = False  # lost, and behind something as it seems

    def __post_init__(self) -> None:
        self._remember(self.seen_s)

    def _remember(self, time_s: float) -> None:
        """The confidence of this frame, and forget those of long ago."""
        self.confidences.append((time_s, _confidence(self.estimate)))
        while len(self.confidences) > LATE_FRAMES and self.confidences[0][0] < time_s - LATE_S:
            del self.confidences[0]

    def is_as_sure(self, estimate: PoseEstimate) -> bool:
        """Whether the estimate's confidence has not fallen."""
        return _confidence(estimate) >= FALLEN * float(np.median([c for _, c in self.confidences]))

    def goes_behind(self, estimate: PoseEstimate) -> bool:
        """Whether the estimate is of what hides this person: unforeseen, and with a confidence that has fallen.

        Either alone is not enough: a somersault is unforeseen, whoever turns away from the light is less sure.
        """
        unforeseen = self.age >= SETTLED_FRAMES and self.surprise(estimate) > STARTLE
        return unforeseen and not self.is_as_sure(estimate)

    def is_hidden_by(self, estimate: PoseEstimate) -> bool:
        """Whether a body was found where this person is hidden, no surer than when they were lost."""
        places = self.foretold, self.estimate.next_region
        near = any(estimate.region.resembles(place, HIDING_PLACE) for place in places)
        return self.is_hidden and near and not self.is_as_sure(estimate)

    @property
    def expected(self) -> Region:
        """Where to look in the frame after the next one, before the next one is known."""
        region = self.estimate.next_region
        x, y = np.asarray(region.center_px) + self.velocity_px
        return replace(region, center_px=(float(x), float(y)))

    @property
    def foretold(self) -> Region:
        """Where to look ``lost`` frames later: the middle goes on as it went."""
        region = self.estimate.next_region
        x, y = np.asarray(region.center_px) + self.velocity_px * self.lost
        return replace(region, center_px=(float(x), float(y)))

    def surprise(self, estimate: PoseEstimate) -> float:
        """Mean distance of the keypoints from where motion foretold them, in sides of the region."""
        foretold = self.estimate.keypoints_px + self.velocity_px * max(self.lost, 1)
        return apart(estimate.keypoints_px, foretold) / self.estimate.region.side_px

    def go_on(self, estimate: PoseEstimate, swapped: bool, time_s: float, step_s: float) -> None:
        """Be there in this frame; ``swapped``: left and right changed places since the one before."""
        step = (estimate.keypoints_px - self.estimate.keypoints_px).mean(axis=0)
        memory = min(_VELOCITY_MEMORY, self.age / (self.age + 1))
        self.velocity_px = memory * self.velocity_px + (1 - memory) * step
        self.swapped |= swapped
        self.estimate, self.age = estimate, self.age + 1
        self.seen_s, self.followed_s = time_s, self.followed_s + step_s
        self._remember(time_s)


def _confidence(estimate: PoseEstimate) -> float:
    return float(estimate.keypoints_confidence.mean())


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """Mean distance of points (..., n)."""
    return float(np.linalg.norm(a - b, axis=-1).mean())
