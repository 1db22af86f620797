# SPDX-License-Identifier: GPL-3.0-or-later
"""The observation of one window: its trackers, and what they have found so far."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ...camera.camera_rotation import BackgroundTracker
from ...media.exposure import AutoExposure
from ...media.frame import Frame
from ...perception.observation import Observation
from ...perception.region import Region
from ...tracking.landmarks.mask_schedule import MaskSchedule
from ...tracking.scene_cuts import SceneCuts
from ...tracking.track import Tracklet
from ..clock import StageClock
from ..networks import Trackers
from .plan import Window
from .window_record import WindowRecord


class WindowRun:
    """Takes the frames of one window in order, from that in which its trackers begin; none is kept.

    :param trackers: that have seen nothing, as ``masks`` and ``background``.
    :param pool: in which the background is followed while the networks run on the next frame.
    """

    def __init__(
        self,
        window: Window,
        following: Window | None,
        trackers: Trackers,
        masks: MaskSchedule,
        background: BackgroundTracker,
        pool: ThreadPoolExecutor,
        clock: StageClock,
    ) -> None:
        self.window = window
        self._following = following
        self._trackers = trackers
        self._masks = masks
        self._cuts = SceneCuts()
        self.background = background
        self._pool = pool
        self._clock = clock
        self._exposure = AutoExposure()
        # in the brightness that the networks are given
        self._upcoming_lit: NDArray[np.uint8] | None = None
        self._pending: Future[None] | None = None
        self._indices: list[int] = []
        self._times: list[float] = []
        self._checksums: list[int] = []
        self._first = 0
        self._anchor = -1
        self._tracklets: dict[int, Tracklet] = {}
        self._anchor_regions: dict[int, Region] = {}
        self._cut_rows: list[int] = []

    def add(self, frame: Frame, upcoming: Frame | None) -> Observation | None:
        """Observe the next frame, and return its largest person.

        :param upcoming: the frame after it, also if that is in the next window; None at the end of
            the clip.
        """
        with self._clock.stage("decode"):
            lit = (
                self._exposure.brighten(frame.image_rgb)
                if self._upcoming_lit is None
                else self._upcoming_lit
            )
            self._upcoming_lit = (
                None if upcoming is None else self._exposure.brighten(upcoming.image_rgb)
            )
        time_s = frame.timestamp_s
        row = len(self._times)
        is_own = self.window.has_begun(time_s)
        with self._clock.stage("networks"):
            is_cut = self._cuts.is_cut(
                frame.image_rgb, None if upcoming is None else upcoming.image_rgb
            )
        observations = self._observe(lit, time_s, is_cut, is_own)
        if is_cut and is_own:
            self._cut_rows.append(row)
        self._first += not is_own
        is_anchor = (
            self._anchor < 0 and self._following is not None and self._following.warms_up(time_s)
        )
        if is_anchor:
            self._anchor = row
            self._anchor_regions = {
                number: observation.region for number, observation in observations
            }
        is_shared = not is_own or self._anchor >= 0
        self._checksums.append(
            zlib.crc32(np.ascontiguousarray(frame.image_rgb).data) if is_shared else 0
        )
        self._indices.append(frame.index)
        self._times.append(time_s)
        for number, observation in observations:
            self._tracklets.setdefault(number, Tracklet()).add(row, observation)
        people = [observation for _, observation in observations]
        with self._clock.stage("background"):
            self._wait()
            points = [observation.keypoints_px for observation in people]
            self._pending = self._pool.submit(
                self.background.add, frame.image_rgb, time_s, points, is_cut, is_anchor
            )
        return max(people, key=lambda observation: observation.region.side_px, default=None)

    def record(self, execution: str = "", warnings: Sequence[str] = ()) -> WindowRecord:
        """Return what was found so far; waits for the background and the reference network."""
        self._wait()
        for tracklet in self._tracklets.values():
            for _, call in tracklet.references:
                call.result()
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

    def _observe(
        self, lit: NDArray[np.uint8], time_s: float, is_cut: bool, with_masks: bool
    ) -> list[tuple[int, Observation]]:
        """Return tracklet number and observation of each person in a frame (H, W, 3).

        :param with_masks: whether the frame counts in the schedule of the outlines.
        """
        if is_cut:
            self._trackers.people.forget()
        with self._clock.stage("networks"):
            due = with_masks and self._masks.upcoming_is_due
            observations = self._trackers.people.step(lit, self._upcoming_lit, time_s, due)
            if with_masks:
                observations = self._masks.add(lit, observations)
        if self._trackers.hands is not None:
            with self._clock.stage("hands"):
                observations = self._trackers.hands.step(lit, observations, time_s)
        if self._trackers.faces is not None:
            with self._clock.stage("face"):
                observations = self._trackers.faces.step(lit, observations, time_s)
        return observations

    def _wait(self) -> None:
        if self._pending is not None:
            self._pending.result()
