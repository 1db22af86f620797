# SPDX-License-Identifier: GPL-3.0-or-later
"""The windows of a clip: where each begins and ends, and what was observed in it.

All tracking starts afresh in each window, so what is observed in it depends on its frames alone. It
does so a little before the window, for the frames in which people are found and the regions settle;
these frames belong to the window before.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Float64Array
from ...notices import Notice
from ..camera.background_record import BackgroundRecord
from ..media.frame import Frame
from ..media.video import Video
from ..perception.observation import Observation, PendingReference
from ..perception.region import Region
from ..stages.observe import FrameObserver, largest_first
from ..tracking.track import Tracklet

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
