# SPDX-License-Identifier: GPL-3.0-or-later
"""The observation of one window: its trackers, and what they have found so far."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from ...camera.camera_rotation import BackgroundTracker
from ...media.exposure import AutoExposure
from ...media.frame import Frame
from ...perception.observation import Observation
from ...perception.region import Region
from ...tracking.track import Tracklet
from ..clock import StageClock
from ..frame_observer import BrightenedFrame, FrameObserver
from .plan import Window
from .window_record import WindowRecord, known_reference


class WindowRun:
    """Takes the frames of one window in order, from that in which its trackers begin.

    :param observer: with trackers that have seen nothing.
    :param background: likewise.
    :param pool: in which the background is followed while the networks run on the next frame.
    :param following: the next window, if there is one.
    """

    def __init__(
        self,
        window: Window,
        following: Window | None,
        observer: FrameObserver,
        background: BackgroundTracker,
        pool: ThreadPoolExecutor,
        clock: StageClock,
    ) -> None:
        self.window, self._following = window, following
        self._observer, self.background, self._pool, self._clock = observer, background, pool, clock
        self._exposure = AutoExposure()
        self._upcoming: BrightenedFrame | None = None
        self._pending: Future[None] | None = None
        self._indices: list[int] = []
        self._times: list[float] = []
        self._checksums: list[int] = []
        self._first, self._anchor = 0, -1
        self._tracklets: dict[int, Tracklet] = {}
        self._anchor_regions: dict[int, Region] = {}
        self._cut_rows: list[int] = []

    def add(self, frame: Frame, upcoming: Frame | None) -> Observation | None:
        """Observe the next frame, and return its largest person.

        :param upcoming: the frame after it, also if that is in the next window; None at the end of the clip.
        """
        with self._clock.stage("decode"):  # as for a short clip
            now = self._upcoming or self._brighten(frame)
            self._upcoming = None if upcoming is None else self._brighten(upcoming)
        time_s, row = frame.timestamp_s, len(self._times)
        is_own = self.window.has_begun(time_s)
        observations, is_cut = self._observer.step(now, self._upcoming, with_masks=is_own)
        if is_cut and is_own:
            self._cut_rows.append(row)
        self._first += not is_own
        is_anchor = self._anchor < 0 and self._following is not None and self._following.warms_up(time_s)
        if is_anchor:
            self._anchor = row
            self._anchor_regions = {number: observation.region for number, observation in observations}
        is_shared = not is_own or self._anchor >= 0
        self._checksums.append(zlib.crc32(np.ascontiguousarray(frame.image_rgb).data) if is_shared else 0)
        self._indices.append(frame.index)
        self._times.append(time_s)
        for number, observation in observations:
            self._tracklets.setdefault(number, Tracklet()).add(row, observation)
        people = [observation for _, observation in observations]
        with self._clock.stage("background"):
            self._wait()
            points = [observation.keypoints_px for observation in people]
            self._pending = self._pool.submit(self.background.add, frame.image_rgb, time_s, points, is_cut, is_anchor)
        return max(people, key=lambda observation: observation.region.side_px, default=None)

    def record(self, execution: str = "", warnings: Sequence[str] = ()) -> WindowRecord:
        """Return what was found so far; waits for the background and the reference network."""
        self._wait()
        for tracklet in self._tracklets.values():
            tracklet.references = [(row, known_reference(call.result())) for row, call in tracklet.references]
        return WindowRecord(
            self.window,
            np.array(self._indices, np.int64),
            np.array(self._times, float),
            np.array(self._checksums, np.uint32),
            self._first,
            len(self._times) if self._anchor < 0 else self._anchor,
            self._tracklets,
            self._anchor_regions,
            list(self._cut_rows),
            self.background.record(),
            execution,
            tuple(warnings),
        )

    def _brighten(self, frame: Frame) -> BrightenedFrame:
        return BrightenedFrame(frame, self._exposure.brighten(frame.image_rgb))

    def _wait(self) -> None:
        if self._pending is not None:
            self._pending.result()
