# SPDX-License-Identifier: GPL-3.0-or-later
"""The windows of a clip joined: one list of frames, and tracklets that go on across the seams.

Two windows have followed the people in the frames that they share. Two tracklets are the same
person if both last until the end of these frames, with keypoints in the same places over the last
of them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...arrays import Float32Array
from ...notices import Notice
from ..camera.background_record import BackgroundRecord, joined_backgrounds
from ..perception.observation import Observation
from ..perception.region import Region
from ..stages.observe import Observed
from ..tracking.people import cheapest_links
from ..tracking.track import Tracklet, trunk_px
from .windows import WindowRecord

_NOWHERE = Region((0.0, 0.0), 1.0, 0.0)
# Two tracklets whose keypoints are closer in the mean, in sides of the region, are one person.
SAME_PERSON = 0.15
COMPARED_FRAMES = 10
# Closer ones are faded into each other; in others, left and right may be swapped.
SAME_POSE = 0.04


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
        self.warnings: list[Notice] = []
        self.execution = ""

    def __len__(self) -> int:
        return len(self.timestamps)

    def accepts(self, record: WindowRecord) -> bool:
        """Return whether a record surely follows the last one frame by frame, however its frames
        were decoded.

        Without common frames that is not known.
        """
        return self._last is None or (record.first > 0 and record.continues(self._last))

    def missed(self, record: WindowRecord) -> list[Region]:
        """Return the regions in which the next window has to begin, where it has lost somebody;
        else none.
        """
        if self._last is None or not record.first or not missed_people(self._last, record):
            return []
        return list(self._last.anchor_regions.values())

    def add(self, record: WindowRecord) -> None:
        """Append the next window; one without frames of its own changes nothing."""
        self.execution = self.execution or record.execution
        if len(record) == record.first:
            return
        self.warnings += [each for each in record.warnings if each not in self.warnings]
        first = record.first
        base = len(self._frames)
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
        self._numbers = numbers
        self._last = record

    def observed(self, execution: str, warnings: list[Notice]) -> Observed:
        """Return what was observed in the whole clip; there must be a frame.

        :param execution: what the networks of this process ran on; empty: it has run none.
        :param warnings: of this process.
        """
        more = [each for each in self.warnings if each not in warnings]
        return Observed(
            self._frames,
            self.timestamps,
            self._cut_rows,
            self._people,
            joined_backgrounds(self._backgrounds, self._firsts),
            execution or self.execution,
            warnings + more,
        )

    def largest_people(self, first_row: int) -> Iterator[tuple[float, Observation]]:
        """Yield the time and the largest person of each frame from a row on in which somebody was
        seen.

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
            yield (
                self.timestamps[row],
                Observation(px, confidence[:, 0], world, 1.0, _NOWHERE, acquired=True),
            )

    def _continue(
        self, place: int, number: int, tracklet: Tracklet, own: Tracklet, overlap: int
    ) -> None:
        """Append a tracklet's own frames to the one that it continues, and fade it in over the
        frames before.
        """
        assert self._last is not None
        joined = self._people[place]
        last = self._last.tracklets[number]
        behind = len(joined.rows) - len([row for row in last.rows if row >= self._last.first])
        skipped = len([row for row in last.rows if row < self._last.first])
        for k, value in faded(last, tracklet, self._last.anchor, overlap).items():
            joined.values[behind + k - skipped] = value
            joined.centers_px[behind + k - skipped] = trunk_px(value[:, :2])
        joined.extend(own)


def same_people(before: WindowRecord, after: WindowRecord) -> dict[int, int]:
    """Return for each tracklet of the later window that continues one of the earlier window, the
    number of that one.
    """
    overlap = after.first
    if not overlap or len(before) - before.anchor != overlap:
        return {}
    old = _lasting(before, len(before) - 1)
    new = _lasting(after, overlap - 1)
    cost = np.full((len(new), len(old)), SAME_PERSON)
    rows = max(0, overlap - COMPARED_FRAMES), overlap
    for i, later in enumerate(new):
        for j, earlier in enumerate(old):
            apart = distance(before.tracklets[earlier], after.tracklets[later], before.anchor, rows)
            cost[i, j] = min(apart, SAME_PERSON)
    links = cheapest_links(cost, SAME_PERSON)
    return {new[i]: old[j] for i, j in links.items()}


def missed_people(before: WindowRecord, after: WindowRecord) -> bool:
    """Return whether somebody who was followed throughout the shared frames was not found there
    again.
    """
    overlap = len(before) - before.anchor
    if not overlap:
        return False
    found = set(same_people(before, after).values())
    followed = [
        number
        for number in _lasting(before, len(before) - 1)
        if len(before.tracklets[number].rows) >= overlap
        and before.tracklets[number].rows[-overlap] == before.anchor
    ]
    return not found.issuperset(followed)


def distance(earlier: Tracklet, later: Tracklet, offset: int, rows: tuple[int, int]) -> float:
    """Return the mean distance of the keypoints in the frames that two tracklets share, in sides of
    the region.

    :param offset: the row of the earlier window that is row 0 of the later one.
    :param rows: the first and the end of the rows of the later window that are compared.
    :return: inf if there are none.
    """
    places = {row - offset: k for k, row in enumerate(earlier.rows)}
    found = []
    for k, row in enumerate(later.rows):
        if rows[0] <= row < rows[1] and row in places:
            other = places[row]
            apart = np.linalg.norm(
                later.values[k][:, :2] - earlier.values[other][:, :2], axis=1
            ).mean()
            found.append(float(apart) / min(later.sides_px[k], earlier.sides_px[other]))
    return float(np.mean(found)) if found else np.inf


def faded(earlier: Tracklet, later: Tracklet, offset: int, overlap: int) -> dict[int, Float32Array]:
    """Return the values of the shared frames, which go over from the earlier tracklet to the later
    one.

    value(i) = (1 − a) earlier(i) + a later(i), with a rising evenly over the overlap. Else the body
    would jump by some pixels at the seam: two trackers that began at different frames look at
    slightly different regions.

    :param offset: the row of the earlier window that is row 0 of the later one.
    :return: by the place in the earlier tracklet; empty where the poses are not the same.
    """
    if distance(earlier, later, offset, (0, overlap)) > SAME_POSE:
        return {}
    places = {row - offset: k for k, row in enumerate(earlier.rows)}
    values: dict[int, Float32Array] = {}
    for k, row in enumerate(later.rows):
        if row < overlap and row in places:
            a = np.float32((row + 1) / (overlap + 1))
            values[places[row]] = (1 - a) * earlier.values[places[row]] + a * later.values[k]
    return values


def _lasting(record: WindowRecord, row: int) -> list[int]:
    """Return the tracklets that were seen in a row."""
    return [number for number, tracklet in record.tracklets.items() if row in tracklet.rows]
