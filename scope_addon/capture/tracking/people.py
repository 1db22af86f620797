# SPDX-License-Identifier: GPL-3.0-or-later
"""The people of a clip: collects what the tracker sees and decides, at the end, who is who and who counts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..perception.observation import Observation
from .association import link
from .scene_cuts import SCENE_GAP_S
from .track import Track, Tracklet, make_track

SHORTEST_SHARE = 0.02  # seen in fewer frames than this, a "person" is a mistake of the detector
SHORTEST_S = 0.3  # the same for the longest time without interruption
LEAST_PROMINENCE = 0.05  # of the most prominent person's
MERGED = 0.25  # mean distance of the keypoints, in sides of the region, of somebody who is becoming somebody else
LONGEST_MERGER_S = 0.38
SHORTEST_AGAIN_S = 0.1  # who was lost, seen again for less than this and lost again, was somebody or something else


class PeopleBuilder:
    """Collects observations frame by frame; what it keeps grows by a kilobyte per person and frame."""

    def __init__(self) -> None:
        self._frames: list[int] = []
        self._times: list[float] = []
        self._tracklets: dict[int, Tracklet] = {}
        self._away_s = 0.0
        self.timestamps: list[float] = []  # when each frame is shown

    def add(self, frame: int, time_s: float, observations: Sequence[tuple[int, Observation]]) -> None:
        """Append one frame: everybody who was seen in it, with the number of the tracklet."""
        row = len(self._frames)
        self._frames.append(frame)
        self.timestamps.append(time_s)
        self._times.append(time_s + self._away_s)
        for number, observation in observations:
            self._tracklets.setdefault(number, Tracklet()).add(row, observation)

    def cut(self) -> None:
        """Another scene begins with the next frame: it counts as long after, so that nothing is drawn from one into it.

        The tracks' times say so; ``timestamps`` do not.
        """
        self._away_s += SCENE_GAP_S

    def __len__(self) -> int:
        return len(self._frames)

    def build(self, most: int) -> list[Track]:
        """At most ``most`` people, the most prominent (size times frames) first; each track has a row per frame.

        Nobody, if even the most prominent one was seen in too few frames to be believed.
        """
        if not self._tracklets:
            return []
        tracklets = list(self._tracklets.values())
        for tracklet in tracklets:
            trim_flickering_end(tracklet, self._times)
            trim_merged_end(tracklet, tracklets, self._times)
        people = [[tracklets[k] for k in chain] for chain in link(tracklets, self._times)]
        people.sort(key=_prominence, reverse=True)
        counted = self._believable(people)[:most]
        least = LEAST_PROMINENCE * _prominence(counted[0]) if counted else 0.0
        return [make_track(self._frames, self._times, person) for person in counted if _prominence(person) >= least]

    def _believable(self, people: list[list[Tracklet]]) -> list[list[Tracklet]]:
        """Those who were seen often enough, and for long enough without interruption.

        At a low rate, where a single frame lasts so long, somebody may be elsewhere in every one: where nobody was
        followed from frame to frame, one is enough.
        """
        often = [person for person in people if sum(len(t.rows) for t in person) >= SHORTEST_SHARE * len(self)]
        lasts = [max(self._times[t.rows[-1]] - self._times[t.rows[0]] for t in person) for person in often]
        least = min(SHORTEST_S, 0.5 * (self._times[-1] - self._times[0]))
        if max(lasts, default=0.0) < least and np.median(np.diff(self._times)) >= SHORTEST_S:
            least = 0.0
        return [person for person, s in zip(often, lasts, strict=True) if s >= least]


def trim_merged_end(tracklet: Tracklet, others: Sequence[Tracklet], times: Sequence[float]) -> None:
    """Take off the last frames of a tracklet that slid onto somebody who goes on to be seen after its end.

    That is how a tracklet ends when its person goes behind somebody else: for some frames the network already sees a
    part of the one in front.
    """
    if not tracklet.rows:
        return
    end = tracklet.rows[-1]
    keep = len(tracklet.rows)
    for other in others:
        if other is tracklet or not other.rows or other.rows[-1] <= end or other.rows[0] > end:
            continue
        at = {row: k for k, row in enumerate(other.rows)}
        for k in range(len(tracklet.rows) - 1, 0, -1):
            j = at.get(tracklet.rows[k])
            if j is None or times[end] - times[tracklet.rows[k]] > LONGEST_MERGER_S:
                break
            apart = np.linalg.norm(tracklet.values[k][:, :2] - other.values[j][:, :2], axis=1).mean()
            if apart > MERGED * min(tracklet.sides_px[k], other.sides_px[j]):
                break
            keep = min(keep, k)
    tracklet.cut(keep)


def trim_flickering_end(tracklet: Tracklet, times: Sequence[float]) -> None:
    """Take off the last frames of a tracklet that come after a gap and are too few to be believed.

    Their place would mislead those who ask where the person went.
    """
    end = len(tracklet.rows)
    while end:
        start = end - 1
        while start and tracklet.rows[start] == tracklet.rows[start - 1] + 1:
            start -= 1
        if not start or times[tracklet.rows[end - 1]] - times[tracklet.rows[start]] >= SHORTEST_AGAIN_S:
            break
        end = start
    tracklet.cut(end)


def _prominence(person: list[Tracklet]) -> float:
    return sum(t.prominence for t in person)
