# SPDX-License-Identifier: GPL-3.0-or-later
"""The networks of a capture, opened as its options say."""

from __future__ import annotations

import os
from typing import NamedTuple

from ...notices import notice
from ...options.capture import AUTO, LARGEST, OFF
from ..options import CaptureOptions, most_people
from ..perception.execution import Execution
from ..perception.landmark_network import EstimateMemory
from ..tracking.face.face_tracker import FaceTracker
from ..tracking.hands.hand_tracker import LARGE_HAND_PX, SMALLEST_HAND_PX, HandTracker
from ..tracking.tracker import PeopleTracker


class Trackers(NamedTuple):
    """The trackers of people, and of what is captured only on request."""

    people: PeopleTracker
    hands: HandTracker | None
    faces: FaceTracker | None


def network_threads(wanted: int, execution: Execution) -> int:
    """Return how many threads to use: at most as many as there are cores, since more would wait for
    each other.
    """
    cores = os.cpu_count() or 1
    if wanted > cores:
        execution.warnings.append(notice("too_many_threads", threads=wanted, cores=cores))
    return min(wanted or cores, cores)


def open_trackers(
    options: CaptureOptions,
    threads: int,
    execution: Execution,
    memory: EstimateMemory | None = None,
) -> Trackers:
    """Open the networks for people, and for what is captured only on request.

    :param memory: of the estimates of an earlier capture.
    """
    people = PeopleTracker(
        options.quality,
        threads,
        None if options.people == LARGEST else most_people(options.people),
        detector=options.detector,
        keypoints=options.keypoints,
        execution=execution,
    )
    people.remember_in(memory)
    least_px = LARGE_HAND_PX if options.hands == AUTO else SMALLEST_HAND_PX
    hands = (
        None
        if options.hands == OFF
        else HandTracker(threads, execution=execution, least_px=least_px)
    )
    # The face's small layers take twice the processor time in two threads, which mostly wait for
    # each other.
    return Trackers(people, hands, FaceTracker(1, execution=execution) if options.face else None)
