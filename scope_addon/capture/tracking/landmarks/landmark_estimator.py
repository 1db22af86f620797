# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks of the people who are tracked, estimated one frame ahead in the background where that is possible."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ...perception.landmark_network import LandmarkNetwork, PoseEstimate
from ...perception.observation import PendingReference
from ...perception.region import Region
from ..tracked_target import MIN_VELOCITY_FRAMES, TrackedTarget
from .plausibility import is_in_image, is_plausible, is_same_region
from .tracking_networks import TrackingNetworks

MAX_PENDING = 2  # calls that are not finished, each of which keeps its frame in memory


class LandmarkEstimator:
    """Runs the landmark network, and keeps pending estimates in the targets."""

    def __init__(self, networks: TrackingNetworks) -> None:
        self._landmarks, self._early = networks.landmarks, networks.begins_early
        self._prefetches = networks.prefetches
        self._with_masks = self._upcoming_with_masks = False

    def advance(self, upcoming_with_masks: bool) -> None:
        """Go to the next frame.

        :param upcoming_with_masks: whether the people of the frame after it need masks.
        """
        self._with_masks, self._upcoming_with_masks = self._upcoming_with_masks, upcoming_with_masks

    def estimate(
        self, image_rgb: NDArray[np.uint8], regions: Sequence[Region], sure: bool = True
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
        self, image_rgb: NDArray[np.uint8], upcoming_rgb: NDArray[np.uint8] | None, live: Sequence[TrackedTarget]
    ) -> list[PoseEstimate | None]:
        """Estimate everybody who is tracked in this frame, and start the estimates of the upcoming one.

        A pending estimate counts if the frame before confirms its region.

        :param image_rgb: (H, W, 3).
        :param upcoming_rgb: (H, W, 3) or None; the largest network starts on it in predicted regions.
        :param live: in the state of the frame before; their ``pending`` is replaced.
        :return: an estimate for each target; None where the landmarks are not those of a body.
        """
        calls = [f.pending for f in live]
        for f in live:
            f.pending = None
            if upcoming_rgb is None or self._early is None or not self._prefetches or f.age < MIN_VELOCITY_FRAMES:
                continue
            if is_in_image(f.prefetch_region, upcoming_rgb):
                f.pending = self._early.begin(upcoming_rgb, f.prefetch_region, self._upcoming_with_masks)
        found: dict[int, PoseEstimate | None] = {}
        for f, call in zip(live, calls, strict=True):
            estimate = call.result() if call is not None else None
            if estimate is not None and is_same_region(estimate.region, f.estimate.next_region):
                found[f.tracklet] = estimate if is_plausible(estimate) else None
        missing = [f for f in live if f.tracklet not in found]
        estimates = self.estimate(image_rgb, [f.estimate.next_region for f in missing])
        found |= {f.tracklet: estimate for f, estimate in zip(missing, estimates, strict=True)}
        return [found[f.tracklet] for f in live]

    def begin_upcoming(self, upcoming_rgb: NDArray[np.uint8] | None, live: Sequence[TrackedTarget]) -> None:
        """Start the estimates of the next frame that are not pending yet; they run in parallel with this one's rest.

        :param upcoming_rgb: (H, W, 3) or None.
        :param live: in the state of this frame; their ``pending`` is set.
        """
        if upcoming_rgb is None or self._early is None:
            return
        for f in live:
            if f.pending is None and is_in_image(f.estimate.next_region, upcoming_rgb):
                f.pending = self._early.begin(upcoming_rgb, f.estimate.next_region, self._upcoming_with_masks)


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
