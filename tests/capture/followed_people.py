# SPDX-License-Identifier: GPL-3.0-or-later
"""The tracks of people who were followed frame by frame."""

from __future__ import annotations

from collections.abc import Sequence

from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.tracking.people import people_of
from scope.scope_addon.capture.tracking.track import Track, Tracklet, make_track


class FollowedPeople:
    """Collects a tracker's observations; frames are given in order."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._tracklets: dict[int, Tracklet] = {}

    def add(self, time_s: float, observations: Sequence[tuple[int, Observation]]) -> None:
        for number, observation in observations:
            self._tracklets.setdefault(number, Tracklet()).add(len(self._times), observation)
        self._times.append(time_s)

    def tracks(self, most: int) -> list[Track]:
        people = people_of(self._times, list(self._tracklets.values()))[0]
        return [
            make_track(range(len(self._times)), self._times, person) for person in people[:most]
        ]
