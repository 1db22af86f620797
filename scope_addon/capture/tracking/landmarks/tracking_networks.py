# SPDX-License-Identifier: GPL-3.0-or-later
"""The networks that tracking uses: built-in ones by quality, or the user's own."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ....errors import SetupError
from ...perception.adapters.detectors.box_detector import BoxDetector
from ...perception.adapters.keypoints.keypoint_network import KeypointNetwork
from ...perception.execution import Execution
from ...perception.kept.kept_estimates import KeptEstimates
from ...perception.landmark_network import LandmarkNetwork
from ...perception.person_detector import PersonDetector
from ...perception.sessions import landmark_network_name


@dataclass(frozen=True)
class TrackingNetworks:
    """Opened networks.

    ``begins_early`` is the network for landmarks if it can work on the next frame in the background; ``prefetches``
    says whether it may do so in regions that are only predicted. Only the largest network does: the others are less
    stable there, and save less time. ``reference`` is the largest network, which checks left and right, or None if it
    estimates the landmarks itself. ``fallback`` replaces a smaller network for a while; a user's own network is not
    replaced.
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
    kept: KeptEstimates | None = None,
) -> TrackingNetworks:
    """Open the networks, with the parameters of `PeopleTracker`.

    :raises UsageError: the quality is unknown.
    :raises SetupError: a built-in network is missing.
    :raises ModelFileError: one of the user's networks cannot be used.
    """
    people: PersonDetector | BoxDetector = (
        BoxDetector(detector, threads, execution) if detector else PersonDetector(threads, execution)
    )
    name, largest = landmark_network_name(quality), landmark_network_name("best")
    reference: LandmarkNetwork | None = None
    if keypoints:
        own = KeypointNetwork(keypoints, threads, execution)
        with suppress(SetupError):  # without the reference, left and right follow from continuity alone
            reference = LandmarkNetwork(largest, 1, execution, kept)
        return TrackingNetworks(people, own, None, False, reference, None)
    landmarks = LandmarkNetwork(name, threads, execution, kept)
    if name != largest:
        reference = LandmarkNetwork(largest, 1, execution, kept)
    return TrackingNetworks(people, landmarks, landmarks, reference is None, reference, reference)
