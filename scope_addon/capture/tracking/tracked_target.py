# SPDX-License-Identifier: GPL-3.0-or-later
"""The tracker's state of one person: prediction, estimate, confidence, occlusion.

A person who becomes occluded is seen with less and less confidence, until the landmarks jump onto
the occluder. From then on the networks may report a body there for seconds, with full confidence.
"""

from __future__ import annotations

import math
from concurrent.futures import Future
from dataclasses import dataclass, field

import numpy as np

from ...arrays import Float64Array
from ..perception.landmark_network import PoseEstimate
from ..perception.region import Region
from .left_right import mean_distance

OCCLUSION_INNOVATION = 0.08  # see `TrackedTarget.innovation`
CONFIDENCE_DROP = 0.8  # share of the recent confidence below which it has dropped
# The time for which confidence is remembered, and the least number of frames.
RECENT_S = 0.5
RECENT_FRAMES = 5
# The distance from where the person is predicted, or was last seen, in sides of the region.
OCCLUSION_DISTANCE = 0.5
MIN_VELOCITY_FRAMES = 2  # after which the velocity is meaningful
_VELOCITY_MEMORY = 0.7


@dataclass
class TrackedTarget:
    """A person who was seen in the last frame, or lost ``frames_lost`` frames ago.

    ``seen_s`` is the time of the frame in which they were last seen, ``tracked_s`` the total time
    for which they were seen. ``reference_s`` and ``appearance_s`` are values of ``tracked_s``: when
    the reference network was asked, and when the appearance was sampled.
    """

    tracklet: int
    estimate: PoseEstimate
    velocity_px: Float64Array  # (2,) per frame, smoothed
    seen_s: float
    age: int = 0  # frames
    frames_lost: int = 0
    tracked_s: float = 0.0
    reference_s: float = -math.inf
    appearance_s: float = -math.inf
    # Whether left and right were swapped since the reference network was asked.
    swapped: bool = False
    fallback_s: float = -math.inf  # time since which the fallback network is in use
    # The estimate in the next frame, at the predicted region.
    pending: Future[PoseEstimate] | None = None
    # Recent confidences, each with its time.
    confidences: list[tuple[float, float]] = field(default_factory=list)
    is_occluded: bool = False  # lost, and apparently behind something

    def __post_init__(self) -> None:
        self._remember_confidence(self.seen_s)

    def _remember_confidence(self, time_s: float) -> None:
        """Append the confidence of this frame, and drop those that are no longer recent."""
        self.confidences.append((time_s, _confidence(self.estimate)))
        while len(self.confidences) > RECENT_FRAMES and self.confidences[0][0] < time_s - RECENT_S:
            del self.confidences[0]

    def keeps_confidence(self, estimate: PoseEstimate) -> bool:
        """Return whether the estimate's confidence has not dropped below the recent one."""
        return _confidence(estimate) >= CONFIDENCE_DROP * float(
            np.median([c for _, c in self.confidences])
        )

    def becomes_occluded(self, estimate: PoseEstimate) -> bool:
        """Return whether the estimate shows the occluder: far from the prediction, and with less
        confidence.

        Neither is enough on its own. A somersault is far from the prediction, and a person who
        turns away from the light is seen with less confidence.
        """
        is_unexpected = (
            self.age >= MIN_VELOCITY_FRAMES and self.innovation(estimate) > OCCLUSION_INNOVATION
        )
        return is_unexpected and not self.keeps_confidence(estimate)

    def is_occluded_by(self, estimate: PoseEstimate) -> bool:
        """Return whether a body was found where this person is occluded, with no more confidence
        than they had.
        """
        regions = self.predicted_region, self.estimate.next_region
        is_near = any(estimate.region.resembles(region, OCCLUSION_DISTANCE) for region in regions)
        return self.is_occluded and is_near and not self.keeps_confidence(estimate)

    @property
    def prefetch_region(self) -> Region:
        """Predict the region for the frame after the next one, before the next one is known."""
        return self.estimate.next_region.moved(self.velocity_px)

    @property
    def predicted_region(self) -> Region:
        """Predict the region ``frames_lost`` frames later, at constant velocity."""
        return self.estimate.next_region.moved(self.velocity_px * self.frames_lost)

    def innovation(self, estimate: PoseEstimate) -> float:
        """Return the mean distance of the keypoints from the prediction, in sides of the region."""
        predicted_px = self.estimate.keypoints_px + self.velocity_px * max(self.frames_lost, 1)
        return (
            float(mean_distance(estimate.keypoints_px, predicted_px)) / self.estimate.region.side_px
        )

    def update(self, estimate: PoseEstimate, swapped: bool, time_s: float, step_s: float) -> None:
        """Take over the estimate of the next frame.

        :param swapped: whether left and right were swapped since the frame before.
        """
        step = (estimate.keypoints_px - self.estimate.keypoints_px).mean(axis=0)
        memory = min(_VELOCITY_MEMORY, self.age / (self.age + 1))
        self.velocity_px = memory * self.velocity_px + (1 - memory) * step
        self.swapped |= swapped
        self.estimate = estimate
        self.age = self.age + 1
        self.seen_s = time_s
        self.tracked_s = self.tracked_s + step_s
        self._remember_confidence(time_s)


def _confidence(estimate: PoseEstimate) -> float:
    return float(estimate.keypoints_confidence.mean())
