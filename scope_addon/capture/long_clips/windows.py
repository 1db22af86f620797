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

import numpy as np

from ...arrays import Float32Array
from ...notices import Notice
from ..camera.background_record import joined_backgrounds
from ..frame_observer import Observed, Window
from ..media.video import Video
from ..perception.region import Region
from ..tracking.people import cheapest_links
from ..tracking.track import Tracklet, trunk_px

WARM_UP_S = 1.5
MAX_WINDOWS = 10_000
# In a window, on average: otherwise frames far apart would have a window, and a file, each.
_LEAST_FRAMES = 4


def plan_windows(video: Video, window_s: float) -> list[Window]:
    """Return the windows of the chosen range; a single one where it is shorter than two of them, or
    has few frames.

    The last window has whatever is left, also of footage that is longer than its container says.
    """
    start_s = video.wanted.start_s
    count = max(1, min(int(video.length_s / window_s + 1e-9), MAX_WINDOWS))
    if count > 1 and video.wanted.fps is None:
        count = max(1, min(count, video.most_frames // _LEAST_FRAMES))
    begins = [start_s + k * window_s for k in range(count)]
    ends = [*begins[1:], math.inf]
    warm_up_s = min(WARM_UP_S, window_s / 2)
    anchors = [start_s, *(begin - warm_up_s for begin in begins[1:])]
    return [Window(k, *times) for k, times in enumerate(zip(anchors, begins, ends, strict=True))]


# Two tracklets whose keypoints are closer in the mean, in sides of the region, are one person.
SAME_PERSON = 0.15
COMPARED_FRAMES = 10
# Closer ones are faded into each other; in others, left and right may be swapped.
SAME_POSE = 0.04


class JoinedWindows:
    """Takes what was observed in a clip's windows, in order."""

    def __init__(self) -> None:
        self._parts: list[Observed] = []  # without those that have no frame of their own
        self._people: list[Tracklet] = []
        self._numbers: dict[int, int] = {}  # place in `_people` by the tracklet of the last window
        self._execution = ""

    def __len__(self) -> int:
        return sum(len(part) - part.first for part in self._parts)

    def accepts(self, part: Observed) -> bool:
        """Return whether a window surely follows the last one frame by frame, however its frames
        were decoded.

        Without common frames that is not known.
        """
        return not self._parts or (part.first > 0 and part.continues(self._parts[-1]))

    def missed(self, part: Observed) -> list[Region]:
        """Return the regions in which the next window has to begin, where it has lost somebody;
        else none.
        """
        if not self._parts or not part.first or not missed_people(self._parts[-1], part):
            return []
        return self._parts[-1].anchor_regions

    def add(self, part: Observed) -> None:
        """Append the next window; one without frames of its own changes nothing."""
        self._execution = self._execution or part.execution
        first = part.first
        if len(part) == first:
            return
        before = same_people(self._parts[-1], part) if self._parts else {}
        base = len(self)
        numbers: dict[int, int] = {}
        for number, tracklet in part.tracklets.items():
            own = tracklet.since(first, base - first)
            if number in before:
                numbers[number] = self._numbers[before[number]]
                self._continue(numbers[number], before[number], tracklet, own, first)
            elif own.rows:
                numbers[number] = len(self._people)
                self._people.append(own)
        self._numbers = numbers
        self._parts.append(part)

    def observed(self, execution: str, warnings: list[Notice]) -> Observed:
        """Return what was observed in the whole clip; there must be a frame.

        :param execution: what the networks of this process ran on; empty: it has run none.
        :param warnings: of this process.
        """
        frames: list[int] = []
        timestamps: list[float] = []
        cut_rows: list[int] = []
        changes: list[float] = []
        notices = list(warnings)
        for part in self._parts:
            first = part.first
            base = len(frames)
            shift = frames[base - first] - part.frames[0] if 0 < first <= base else 0
            frames += [index + shift for index in part.frames[first:]]
            timestamps += part.timestamps[first:]
            changes += part.picture_changes[first:]
            cut_rows += [base + row - first for row in part.cut_rows]
            notices += [each for each in part.warnings if each not in notices]
        background = joined_backgrounds(
            [part.background for part in self._parts], [part.first for part in self._parts]
        )
        people = dict(enumerate(self._people))
        return Observed(
            frames,
            timestamps,
            cut_rows,
            people,
            background,
            execution or self._execution,
            notices,
            picture_changes=changes,
        )

    def _continue(
        self, place: int, number: int, tracklet: Tracklet, own: Tracklet, overlap: int
    ) -> None:
        """Append a tracklet's own frames to the one that it continues, and fade it in over the
        frames before.
        """
        before = self._parts[-1]
        joined = self._people[place]
        last = before.tracklets[number]
        # Both end with the same frame.
        behind = len(joined.rows) - len(last.rows)
        for k, value in faded(last, tracklet, before.anchor, overlap).items():
            joined.values[behind + k] = value
            joined.centers_px[behind + k] = trunk_px(value[:, :2])
        joined.extend(own)


def same_people(before: Observed, after: Observed) -> dict[int, int]:
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


def missed_people(before: Observed, after: Observed) -> bool:
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
    found = []
    for k, other in _shared_frames(earlier, later, offset, rows):
        apart = np.linalg.norm(later.values[k][:, :2] - earlier.values[other][:, :2], axis=1).mean()
        found.append(float(apart) / min(later.sides_px[k], earlier.sides_px[other]))
    return float(np.mean(found)) if found else np.inf


def _shared_frames(
    earlier: Tracklet, later: Tracklet, offset: int, rows: tuple[int, int]
) -> list[tuple[int, int]]:
    """Return the places of the frames that two tracklets share in the later and in the earlier one;
    see `distance`.
    """
    places = {row - offset: k for k, row in enumerate(earlier.rows)}
    return [
        (k, places[row])
        for k, row in enumerate(later.rows)
        if rows[0] <= row < rows[1] and row in places
    ]


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
    values: dict[int, Float32Array] = {}
    for k, other in _shared_frames(earlier, later, offset, (0, overlap)):
        a = np.float32((later.rows[k] + 1) / (overlap + 1))
        values[other] = (1 - a) * earlier.values[other] + a * later.values[k]
    return values


def _lasting(part: Observed, row: int) -> list[int]:
    """Return the tracklets that were seen in a row."""
    return [number for number, tracklet in part.tracklets.items() if row in tracklet.rows]
