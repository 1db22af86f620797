# SPDX-License-Identifier: GPL-3.0-or-later
"""The windows of a clip joined: one list of frames, and tracklets that go on across the seams."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...camera.background_record import BackgroundRecord, joined_backgrounds
from ...perception.observation import Observation
from ...perception.region import Region
from ...tracking.people import build_tracks
from ...tracking.scene_cuts import SCENE_GAP_S
from ...tracking.track import Track, Tracklet, trunk_px
from .seam import faded, missed_people, same_people
from .window_record import WindowRecord

_NOWHERE = Region((0.0, 0.0), 1.0, 0.0)


class JoinedWindows:
    """Takes the records of a clip's windows in order."""

    def __init__(self) -> None:
        self._frames: list[int] = []
        self.timestamps: list[float] = []
        self._cut_rows: list[int] = []
        self._people: list[Tracklet] = []
        self._numbers: dict[int, int] = {}  # place in `_people` by the tracklet of the last window
        self._last: WindowRecord | None = None
        self._backgrounds: list[BackgroundRecord] = []
        self._firsts: list[int] = []
        self.warnings: list[str] = []
        self.execution = ""

    def __len__(self) -> int:
        return len(self.timestamps)

    def accepts(self, record: WindowRecord) -> bool:
        """Return whether a record surely follows the last one frame by frame, however its frames were decoded.

        Without common frames that is not known.
        """
        return self._last is None or (record.first > 0 and record.continues(self._last))

    def missed(self, record: WindowRecord) -> list[Region]:
        """Return the regions in which the next window has to begin, where it has lost somebody; else none."""
        if self._last is None or not record.first or not missed_people(self._last, record):
            return []
        return list(self._last.anchor_regions.values())

    def add(self, record: WindowRecord) -> None:
        """Append the next window; one without frames of its own changes nothing."""
        self.execution = self.execution or record.execution
        if len(record) == record.first:
            return
        self.warnings += [text for text in record.warnings if text not in self.warnings]
        first, base = record.first, len(self._frames)
        shift = self._frames[base - first] - int(record.indices[0]) if 0 < first <= base else 0
        self._frames += (record.indices[first:] + shift).tolist()
        self.timestamps += record.timestamps[first:].tolist()
        self._cut_rows += [base + row - first for row in record.cut_rows]
        self._backgrounds.append(record.background)
        self._firsts.append(first)
        before = same_people(self._last, record) if self._last is not None else {}
        numbers: dict[int, int] = {}
        for number, tracklet in record.tracklets.items():
            own = tracklet.since(first, base - first)
            if number in before:
                numbers[number] = self._numbers[before[number]]
                self._continue(numbers[number], before[number], tracklet, own, first)
            elif own.rows:
                numbers[number] = len(self._people)
                self._people.append(own)
        self._numbers, self._last = numbers, record

    def tracks(self, most: int) -> list[Track]:
        """Return the tracks of at most ``most`` people; see `build_tracks`."""
        cuts = np.zeros(len(self))
        cuts[self._cut_rows] = 1.0
        times = (np.array(self.timestamps) + SCENE_GAP_S * np.cumsum(cuts)).tolist()
        people = sorted((t for t in self._people if t.rows), key=lambda tracklet: tracklet.rows[0])
        return build_tracks(self._frames, times, people, most)

    def background(self) -> BackgroundRecord:
        """Return the background of the whole clip; there must be a frame."""
        return joined_backgrounds(self._backgrounds, self._firsts)

    def cuts_s(self) -> list[float]:
        """Return the times of the first frames after cuts."""
        return [self.timestamps[row] for row in self._cut_rows]

    def largest_people(self, first_row: int) -> Iterator[tuple[float, Observation]]:
        """Yield the time and the largest person of each frame from a row on in which somebody was seen.

        The observations contain what a fit of their frames needs.
        """
        largest: dict[int, tuple[float, Tracklet, int]] = {}
        for tracklet in self._people:
            for k, (row, side_px) in enumerate(zip(tracklet.rows, tracklet.sides_px, strict=True)):
                if row >= first_row and (row not in largest or side_px > largest[row][0]):
                    largest[row] = side_px, tracklet, k
        for row in sorted(largest):
            _, tracklet, k = largest[row]
            px, confidence, world = np.split(tracklet.values[k].astype(float), (2, 3), axis=1)
            yield self.timestamps[row], Observation(px, confidence[:, 0], world, 1.0, _NOWHERE, acquired=True)

    def _continue(self, place: int, number: int, tracklet: Tracklet, own: Tracklet, overlap: int) -> None:
        """Append a tracklet's own frames to the one that it continues, and fade it in over the frames before."""
        assert self._last is not None
        joined, last = self._people[place], self._last.tracklets[number]
        behind = len(joined.rows) - len([row for row in last.rows if row >= self._last.first])
        skipped = len([row for row in last.rows if row < self._last.first])
        for k, value in faded(last, tracklet, self._last.anchor, overlap).items():
            joined.values[behind + k - skipped] = value
            joined.centers_px[behind + k - skipped] = trunk_px(value[:, :2])
        joined.extend(own)
