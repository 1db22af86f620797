# SPDX-License-Identifier: GPL-3.0-or-later
"""Follows one person through a video: detect once, then let each frame's landmarks say where to look next."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...solver.errors import ShapeError
from .landmark_network import LandmarkNetwork, PoseEstimate
from .networks import landmark_network_name
from .person_detector import Detection, PersonDetector
from .region import Region

PRESENCE_THRESHOLD = 0.5
# See PoseEstimate.spread and .disagreement. Hands fool the detector with scores up to 0.86 and the landmark networks
# with spreads up to 0.36, rarely 0.46: whoever is found with less certainty has to look more like a person.
SPREAD_THRESHOLD = 0.38
DISAGREEMENT_THRESHOLD = 0.25
SURE_SCORE = 0.9
UNSURE_SPREAD_THRESHOLD = 0.47
UNSURE_DISAGREEMENT_THRESHOLD = 0.18
SMALLEST_SIDE_PX = 24.0
LARGEST_SIDE = 6.0  # in longer sides of the image
MEMORY_FRAMES = 60  # how long a lost person is preferred over a stronger one
_CANDIDATES = 3


@dataclass(frozen=True)
class Observation:
    """The person in one frame.

    ``keypoints_px`` (33, 2) pixels of the frame; ``keypoints_confidence`` (33,) 0..1; ``world_landmarks`` (33, 3)
    metres, the middle of the hips at 0, in camera axes (x right, y down, z forward); ``presence``: the network's
    probability that there is a person; ``region``: where it looked; ``acquired``: the person was found by the
    detector in this frame, so it may be another one than in the frame before. Order: `KEYPOINT_NAMES`.
    """

    keypoints_px: np.ndarray
    keypoints_confidence: np.ndarray
    world_landmarks: np.ndarray
    presence: float
    region: Region
    acquired: bool


class PersonTracker:
    """The strongest person of a video. Frames are given in order; `reset` before another video."""

    def __init__(self, quality: str, threads: int, folder: Path | None = None) -> None:
        self._landmarks = LandmarkNetwork(landmark_network_name(quality), threads, folder)
        self._detector = PersonDetector(threads, folder)
        self.reset()

    def reset(self) -> None:
        """Forget the person: the next frame starts with a detection."""
        self._next: Region | None = None
        self._last: Region | None = None
        self._lost_frames = 0

    def step(self, image_rgb: np.ndarray) -> Observation | None:
        """The person in the next frame, (H, W, 3) uint8 RGB, or None when there is nobody.

        The detector runs only where the region that the frame before foretold does not hold a believable body.
        """
        if image_rgb.ndim != 3 or image_rgb.shape[2] != 3 or image_rgb.dtype != np.uint8:
            raise ShapeError(f"A frame must be (H, W, 3) uint8 RGB, but got {image_rgb.shape} {image_rgb.dtype}.")
        estimate = None if self._next is None else self._look(image_rgb, self._next)
        acquired = estimate is None
        if estimate is None:
            estimate = self._acquire(image_rgb)
        if estimate is None:
            self._next = None
            self._lost_frames += 1
            return None
        self._next, self._last, self._lost_frames = estimate.next_region, estimate.region, 0
        return Observation(
            estimate.keypoints_px,
            estimate.keypoints_confidence,
            estimate.world_landmarks,
            estimate.presence,
            estimate.region,
            acquired,
        )

    def _acquire(self, image_rgb: np.ndarray) -> PoseEstimate | None:
        """The first believable body among the detections.

        Each is looked at twice: the landmarks know better than the detector where the body lies.
        """
        for detection in self._ranked(self._detector.detect(image_rgb))[:_CANDIDATES]:
            (first,) = self._landmarks.estimate(image_rgb, [detection.region])
            if first.presence < PRESENCE_THRESHOLD:
                continue
            second = self._look(image_rgb, first.next_region, sure=detection.score >= SURE_SCORE)
            if second is not None:
                return second
        return None

    def _ranked(self, detections: list[Detection]) -> list[Detection]:
        """Whoever may be the person lost a moment ago first, then by score times size."""
        last = self._last if self._lost_frames <= MEMORY_FRAMES else None

        def rank(detection: Detection) -> tuple[bool, float]:
            region = detection.region
            return last is not None and region.resembles(last, 0.5), detection.score * region.side_px

        return sorted(detections, key=rank, reverse=True)

    def _look(self, image_rgb: np.ndarray, region: Region, sure: bool = True) -> PoseEstimate | None:
        """The landmarks in a region, or None when they are not a body in this image."""
        height, width = image_rgb.shape[:2]
        x, y = region.center_px
        reach = region.side_px / 2
        outside = x + reach < 0 or y + reach < 0 or x - reach > width or y - reach > height
        if outside or not SMALLEST_SIDE_PX <= region.side_px <= LARGEST_SIDE * max(height, width):
            return None
        (estimate,) = self._landmarks.estimate(image_rgb, [region])
        believable = (
            estimate.presence >= PRESENCE_THRESHOLD
            and estimate.spread >= (SPREAD_THRESHOLD if sure else UNSURE_SPREAD_THRESHOLD)
            and estimate.disagreement <= (DISAGREEMENT_THRESHOLD if sure else UNSURE_DISAGREEMENT_THRESHOLD)
        )
        return estimate if believable else None
