# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks of the people who are tracked, estimated one frame ahead in the background where that
is possible.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ...arrays import Float64Array, Uint8Array
from ...errors import SetupError
from ..perception.adapters.box_detector import BoxDetector
from ..perception.adapters.keypoint_network import KeypointNetwork
from ..perception.landmark_network import LandmarkNetwork, PoseEstimate
from ..perception.observation import PendingReference
from ..perception.person_detector import PersonDetector
from ..perception.region import Region
from ..perception.sessions import Execution, landmark_network_name
from .plausibility import is_in_image, is_plausible, is_same_region
from .tracked_target import MIN_VELOCITY_FRAMES, TrackedTarget

MAX_PENDING = 2  # calls that are not finished, each of which keeps its frame in memory


class LandmarkEstimator:
    """Runs the landmark network, and keeps pending estimates in the targets."""

    def __init__(self, networks: TrackingNetworks) -> None:
        self._landmarks = networks.landmarks
        self._early = networks.begins_early
        self._prefetches = networks.prefetches
        self._with_masks = self._upcoming_with_masks = False

    def advance(self, upcoming_with_masks: bool) -> None:
        """Go to the next frame.

        :param upcoming_with_masks: whether the people of the frame after it need masks.
        """
        self._with_masks = self._upcoming_with_masks
        self._upcoming_with_masks = upcoming_with_masks

    def estimate(
        self, image_rgb: Uint8Array, regions: Sequence[Region], sure: bool = True
    ) -> list[PoseEstimate | None]:
        """Estimate the landmarks in each region in one batch.

        :param image_rgb: (H, W, 3).
        :param sure: see `is_plausible`.
        :return: an estimate for each region; None where the landmarks are not those of a body.
        """
        useful = [k for k, region in enumerate(regions) if is_in_image(region, image_rgb)]
        wanted = [regions[k] for k in useful]
        if self._with_masks and isinstance(self._landmarks, LandmarkNetwork):
            estimates = self._landmarks.estimate(image_rgb, wanted, with_masks=True)
        else:
            estimates = self._landmarks.estimate(image_rgb, wanted)
        out: list[PoseEstimate | None] = [None] * len(regions)
        for k, estimate in zip(useful, estimates, strict=True):
            out[k] = estimate if is_plausible(estimate, sure) else None
        return out

    def estimate_live(
        self, image_rgb: Uint8Array, upcoming_rgb: Uint8Array | None, live: Sequence[TrackedTarget]
    ) -> list[PoseEstimate | None]:
        """Estimate everybody who is tracked in this frame, and start the estimates of the upcoming
        one.

        A pending estimate counts if the frame before confirms its region.

        :param image_rgb: (H, W, 3).
        :param upcoming_rgb: (H, W, 3) or None; the largest network starts on it in predicted
            regions.
        :param live: in the state of the frame before; their ``pending`` is replaced.
        :return: an estimate for each target; None where the landmarks are not those of a body.
        """
        calls = [f.pending for f in live]
        for f in live:
            f.pending = None
            if self._prefetches and f.age >= MIN_VELOCITY_FRAMES:
                self._begin(upcoming_rgb, f, f.prefetch_region)
        found: dict[int, PoseEstimate | None] = {}
        for f, call in zip(live, calls, strict=True):
            estimate = call.result() if call is not None else None
            if estimate is not None and is_same_region(estimate.region, f.estimate.next_region):
                found[f.tracklet] = estimate if is_plausible(estimate) else None
        missing = [f for f in live if f.tracklet not in found]
        estimates = self.estimate(image_rgb, [f.estimate.next_region for f in missing])
        found |= {f.tracklet: estimate for f, estimate in zip(missing, estimates, strict=True)}
        return [found[f.tracklet] for f in live]

    def begin_upcoming(
        self, upcoming_rgb: Uint8Array | None, live: Sequence[TrackedTarget]
    ) -> None:
        """Start the estimates of the next frame that are not pending yet; they run in parallel with
        this one's rest.

        :param upcoming_rgb: (H, W, 3) or None.
        :param live: in the state of this frame; their ``pending`` is set.
        """
        for f in live:
            if f.pending is None:
                self._begin(upcoming_rgb, f, f.estimate.next_region)

    def _begin(
        self, upcoming_rgb: Uint8Array | None, target: TrackedTarget, region: Region
    ) -> None:
        """Start the estimate of somebody in a region of the next frame, if it is of use there."""
        if upcoming_rgb is None or self._early is None or not is_in_image(region, upcoming_rgb):
            return
        target.pending = self._early.begin(upcoming_rgb, region, self._upcoming_with_masks)


class ReferenceEstimator:
    """Estimates world landmarks in the background; tracking does not depend on them, so it does not
    wait.
    """

    def __init__(self, network: LandmarkNetwork) -> None:
        self._network = network
        self._pending: list[PendingReference] = []
        self._pool = ThreadPoolExecutor(1, "scope-reference")

    def submit(self, image_rgb: Uint8Array, region: Region) -> PendingReference:
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

    def _estimate(self, image_rgb: Uint8Array, region: Region) -> Float64Array | None:
        (estimate,) = self._network.estimate(image_rgb, [region])
        return estimate.world_landmarks if is_plausible(estimate) else None


@dataclass(frozen=True)
class TrackingNetworks:
    """Opened networks.

    ``begins_early`` is the network for landmarks if it can work on the next frame in the
    background; ``prefetches`` says whether it may do so in regions that are only predicted. Only
    the largest network does: the others are less stable there, and save less time. ``reference`` is
    the largest network, which checks left and right, or None if it estimates the landmarks itself.
    ``fallback`` replaces a smaller network for a while; a user's own network is not replaced.
    """

    detector: PersonDetector | BoxDetector
    landmarks: LandmarkNetwork | KeypointNetwork
    begins_early: LandmarkNetwork | None
    prefetches: bool
    reference: LandmarkNetwork | None
    fallback: LandmarkNetwork | None


def open_networks(
    quality: str,
    threads: int,
    detector: Path | None,
    keypoints: Path | None,
    execution: Execution | None,
) -> TrackingNetworks:
    """Open the networks, with the parameters of `PeopleTracker`.

    :raises UsageError: the quality is unknown.
    :raises SetupError: a built-in network is missing.
    :raises ModelFileError: one of the user's networks cannot be used.
    """
    people: PersonDetector | BoxDetector = (
        BoxDetector(detector, threads, execution)
        if detector
        else PersonDetector(threads, execution)
    )
    name = landmark_network_name(quality)
    largest = landmark_network_name("best")
    reference: LandmarkNetwork | None = None
    if keypoints:
        own = KeypointNetwork(keypoints, threads, execution)
        # Without the reference, left and right follow from continuity alone.
        with suppress(SetupError):
            reference = LandmarkNetwork(largest, 1, execution)
        return TrackingNetworks(people, own, None, False, reference, None)
    landmarks = LandmarkNetwork(name, threads, execution)
    if name != largest:
        reference = LandmarkNetwork(largest, 1, execution)
    return TrackingNetworks(people, landmarks, landmarks, reference is None, reference, reference)
