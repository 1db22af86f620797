# SPDX-License-Identifier: GPL-3.0-or-later
"""The windows of a clip: where each begins and ends, and what was observed in it.

All tracking starts afresh in each window, so what is observed in it depends on its frames alone. It
does so a little before the window, for the frames in which people are found and the regions settle;
these frames belong to the window before. Joined, the windows have one list of frames, and tracklets
that go on across the seams: two of them are the same person if both last until the end of the
common frames, with keypoints in the same places over the last of them.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Float32Array, Float64Array
from ...notices import Notice
from ..camera.background_record import BackgroundRecord, joined_backgrounds
from ..media.frame import Frame
from ..media.video import Video
from ..observe import FrameObserver, Observed, largest_first
from ..perception.observation import Observation, PendingReference
from ..perception.region import Region
from ..tracking.people import cheapest_links
from ..tracking.track import Tracklet, trunk_px

WARM_UP_S = 1.5
MAX_WINDOWS = 10_000
# In a window, on average: otherwise frames far apart would have a window, and a file, each.
_LEAST_FRAMES = 4
_TOLERANCE_S = 1e-6  # of a frame's time, as in decoding


@dataclass(frozen=True)
class Window:
    """Frames from ``begin_s`` on, before ``end_s``; the trackers begin at ``anchor_s``."""

    number: int
    anchor_s: float
    begin_s: float
    end_s: float

    def has_begun(self, time_s: float) -> bool:
        """Return whether a frame at this time is not before the window's first one, as none of the
        first window is.
        """
        return not self.number or time_s >= self.begin_s - _TOLERANCE_S

    def warms_up(self, time_s: float) -> bool:
        """Return whether a frame at this time is not before the one in which the trackers begin."""
        return time_s >= self.anchor_s - _TOLERANCE_S

    def has_ended(self, time_s: float) -> bool:
        """Return whether a frame at this time comes after the window's last one."""
        return time_s >= self.end_s - _TOLERANCE_S


def plan_windows(video: Video, window_s: float) -> list[Window]:
    """Return the windows of the chosen range; a single one where it is shorter than two of them, or
    has few frames.

    The last window has whatever is left, also of footage that is longer than its container says.
    """
    start_s = video.wanted.start_s
    length_s = video.expected_frames / float(video.fps)
    count = max(1, min(int(length_s / window_s + 1e-9), MAX_WINDOWS))
    if count > 1 and video.wanted.fps is None:
        count = max(1, min(count, video.most_frames // _LEAST_FRAMES))
    begins = [start_s + k * window_s for k in range(count)]
    ends = [*begins[1:], math.inf]
    warm_up_s = min(WARM_UP_S, window_s / 2)
    anchors = [start_s, *(begin - warm_up_s for begin in begins[1:])]
    return [Window(k, *times) for k, times in enumerate(zip(anchors, begins, ends, strict=True))]


@dataclass
class WindowRecord:
    """N frames from the one in which the trackers began; the first ``first`` of them belong to the
    window before.

    ``checksums`` are those of the images in the frames that two windows share, and 0 elsewhere.
    ``anchor`` is the row in which the trackers of the next window begin, N if there is none, and
    ``anchor_regions`` holds the regions of the people in it, by tracklet. The rows of
    ``tracklets``, whose references are not pending, count from 0. ``cut_rows`` are those of the
    window's own frames that begin another scene. ``execution``: what the networks ran on.
    """

    window: Window
    indices: NDArray[np.int64]  # (N,) of the frames in the source
    timestamps: Float64Array  # (N,) seconds
    checksums: NDArray[np.uint32]  # (N,)
    first: int
    anchor: int
    tracklets: dict[int, Tracklet]
    anchor_regions: dict[int, Region]
    cut_rows: list[int]
    background: BackgroundRecord
    execution: str = ""
    warnings: Sequence[Notice] = ()

    def __len__(self) -> int:
        return len(self.timestamps)

    def continues(self, before: WindowRecord) -> bool:
        """Return whether the frames that this window shares with the one before are the same images
        there.
        """
        same_times = np.array_equal(
            before.timestamps[before.anchor :], self.timestamps[: self.first]
        )
        return same_times and np.array_equal(
            before.checksums[before.anchor :], self.checksums[: self.first]
        )


class WindowRun:
    """Observes the frames of one window in order, from that in which its trackers begin.

    :param following: the next window; None: there is none.
    :param observer: that has seen nothing.
    """

    def __init__(self, window: Window, following: Window | None, observer: FrameObserver) -> None:
        self.window = window
        self._following = following
        self._observer = observer
        self._first = 0
        self._anchor: int | None = None
        self._anchor_regions: dict[int, Region] = {}
        self._checksums: list[int] = []

    def add(self, frame: Frame, upcoming: Frame | None) -> list[Observation]:
        """Observe the next frame, and return its people, the largest first.

        :param upcoming: the frame after it, also if that is in the next window; None at the end of
            the clip.
        """
        time_s = frame.timestamp_s
        is_own = self.window.has_begun(time_s)
        is_anchor = (
            self._anchor is None
            and self._following is not None
            and self._following.warms_up(time_s)
        )
        if is_anchor:
            self._anchor = len(self._checksums)
        is_shared = not is_own or self._anchor is not None
        image = np.ascontiguousarray(frame.image_rgb)
        self._checksums.append(zlib.crc32(image.data) if is_shared else 0)
        self._first += not is_own
        observations = self._observer.add(
            frame, upcoming, counts=is_own, is_sampled=is_anchor, is_shared=is_shared
        )
        if is_anchor:
            self._anchor_regions = {number: each.region for number, each in observations}
        return largest_first(observations)

    def record(self, execution: str = "", warnings: Sequence[Notice] = ()) -> WindowRecord:
        """Return what was found so far."""
        observer = self._observer
        observer.finish()
        frames = len(self._checksums)
        return WindowRecord(
            self.window,
            np.array(observer.frames, np.int64),
            np.array(observer.timestamps, float),
            np.array(self._checksums, np.uint32),
            self._first,
            frames if self._anchor is None else self._anchor,
            observer.tracklets,
            self._anchor_regions,
            list(observer.cut_rows),
            observer.background.record(),
            execution,
            tuple(warnings),
        )


def known_reference(landmarks: NDArray[Any] | None) -> PendingReference:
    """Return the result of the reference network as if it had been pending.

    :param landmarks: (33, 3) metres; None: it found no body.
    """
    call: PendingReference = Future()
    call.set_result(landmarks)
    return call


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
