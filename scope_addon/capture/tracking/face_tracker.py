# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracking of faces: the body's head says where to look first, the face's own landmarks where in
the next frame.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Float64Array, Uint8Array
from ..perception.face_landmarks import (
    HEAD,
    ExpressionNetwork,
    FaceEstimate,
    FaceNetwork,
    eye_light,
    facing,
    region_from_body,
)
from ..perception.face_record import record
from ..perception.observation import Observation
from ..perception.region import Region
from ..perception.sessions import Execution
from .frame_clock import PATIENCE_S, is_search_due

PRESENCE_THRESHOLD = 0.5
# The largest distance of a face from where the body's head predicts it, in sides of that region.
MAX_DISTANCE = 0.35
# The least and largest side of the face's region over that of the predicted one.
MIN_SIZE = 0.5
MAX_SIZE = 1.6
SMALLEST_REGION_PX = 24.0
# Least cosine of the angle to the camera, by the body, of a head on which a lost face is looked
# for. Of heads that look farther away, the network imagines the half that nobody sees, or a face at
# the back.
MIN_FACING = 0.1
# Below this presence in the region by the body, the face is not looked for by its landmarks.
FIRST_PRESENCE = 0.001
# Two faces whose regions' centres are closer, in sides of the smaller region, are one. Those of
# people cheek to cheek are half a side apart.
SAME_FACE = 0.2


@dataclass
class _Face:
    """The state of one person's face: its region in the frame before, and where the body's head
    was, if it was seen.
    """

    region: Region | None
    head_px: Float64Array
    seen_s: float  # when it was last seen; if never, when it was first looked for
    searched_s: float  # when it was last looked for


class FaceTracker:
    """Tracks the faces of the people whom `PeopleTracker` tracks; frames are given in order.

    :raises SetupError: a network is missing.
    :raises ModelFileError: a network is damaged.
    """

    def __init__(self, execution: Execution | None = None) -> None:
        with ThreadPoolExecutor(1) as pool:
            # `with_expressions` may need it: if it is missing or damaged, say so now. Opening takes
            # a core 20 ms.
            opened = pool.submit(ExpressionNetwork)
            self._network = FaceNetwork(execution)
            opened.result()
        self._faces: dict[int, _Face] = {}

    def restarted(self) -> FaceTracker:
        """Return a tracker with the same networks that has seen nothing."""
        tracker = copy.copy(self)
        tracker._faces = {}
        return tracker

    def step(
        self, image_rgb: Uint8Array, observations: Sequence[tuple[int, Observation]], time_s: float
    ) -> list[tuple[int, Observation]]:
        """Add ``face`` to the observations of one frame: its landmarks, from which
        `with_expressions` finds the rest.

        :param image_rgb: (H, W, 3).
        :param observations: tracklet number and observation of each person.
        """
        before = self._faces
        self._faces = {}
        estimates: dict[int, FaceEstimate | None] = {}
        for number, person in observations:
            head = person.keypoints_px[list(HEAD)].mean(axis=0)
            face = before.get(number) or _Face(None, head, time_s, time_s - PATIENCE_S)
            estimates[number] = self._find(image_rgb, face, person, head, time_s)
            face.head_px = head
            self._faces[number] = face
        estimates = without_duplicates(estimates, dict(observations))
        found = []
        for number, person in observations:
            estimate = estimates[number]
            face = self._faces[number]
            face.region = estimate.next_region if estimate else None
            if estimate:
                face.seen_s = time_s
                estimate = replace(estimate, eye_light=eye_light(image_rgb, estimate.landmarks))
            found.append((number, replace(person, face=record(estimate))))
        return found

    def _find(
        self,
        image_rgb: Uint8Array,
        face: _Face,
        person: Observation,
        head_px: Float64Array,
        time_s: float,
    ) -> FaceEstimate | None:
        """Look for the face where it was a frame ago, moved with the head, otherwise where the body
        predicts it.

        There it is estimated twice: the landmarks give a better region than the body.
        """
        predicted = region_from_body(person.keypoints_px)
        if predicted.side_px < SMALLEST_REGION_PX or not np.isfinite(predicted.side_px):
            return None
        if face.region is not None:
            estimate = self._network.estimate(
                image_rgb, face.region.moved(head_px).moved(-face.head_px)
            )
            if belongs(estimate, predicted):
                return estimate
        elif not is_search_due(time_s, face.seen_s, face.searched_s):
            return None
        if facing(person.world_landmarks) < MIN_FACING:
            return None
        face.searched_s = time_s
        first = self._network.estimate(image_rgb, predicted)
        if first.presence < FIRST_PRESENCE or not np.isfinite(first.landmarks).all():
            return None
        second = self._network.estimate(image_rgb, first.next_region)
        return second if belongs(second, predicted) else None


def belongs(estimate: FaceEstimate, predicted: Region) -> bool:
    """Return whether this is a face, and the one of the person for whom the body's head predicts a
    region.
    """
    if estimate.presence < PRESENCE_THRESHOLD or not np.isfinite(estimate.landmarks).all():
        return False
    region = estimate.next_region
    return (
        distance_to(region, predicted) <= MAX_DISTANCE
        and MIN_SIZE * predicted.side_px <= region.side_px <= MAX_SIZE * predicted.side_px
    )


def without_duplicates(
    found: Mapping[int, FaceEstimate | None], people: Mapping[int, Observation]
) -> dict[int, FaceEstimate | None]:
    """Return the faces that were found, None for those that were found as that of another person
    too whose body's head predicts it better.

    :param found: by the person's tracklet number.
    """
    offsets = {
        number: distance_to(estimate.next_region, region_from_body(people[number].keypoints_px))
        for number, estimate in found.items()
        if estimate is not None
    }
    unique: dict[int, FaceEstimate | None] = dict.fromkeys(found)
    regions: list[Region] = []
    for number in sorted(offsets, key=lambda each: offsets[each]):
        estimate = found[number]
        assert estimate is not None
        region = estimate.next_region
        if all(
            _distance_px(region, r) > SAME_FACE * min(region.side_px, r.side_px) for r in regions
        ):
            unique[number] = estimate
            regions.append(region)
    return unique


def distance_to(region: Region, predicted: Region) -> float:
    """Return the distance of a face from where it is predicted, in sides of that region."""
    return _distance_px(region, predicted) / predicted.side_px


def _distance_px(a: Region, b: Region) -> float:
    """Return the distance of two regions' centres."""
    return float(np.hypot(*np.subtract(a.center_px, b.center_px)))
