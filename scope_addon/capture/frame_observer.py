# SPDX-License-Identifier: GPL-3.0-or-later
"""Observes the frames of a clip, or of a window of it, and holds what was found in them."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Uint8Array
from ..clock import StageClock
from ..notices import Notice
from ..scene_gaps import SCENE_GAP_S, cut_times, with_scene_gaps
from .camera.background_record import BackgroundRecord
from .camera.camera_rotation import BackgroundTracker
from .camera.intrinsics import Camera
from .media.frame import AutoExposure, Frame
from .media.video import Video
from .perception.observation import Observation
from .perception.region import Region
from .tracking.chosen_person import ChosenPerson, find_chosen, place_of
from .tracking.face_tracker import FaceTracker
from .tracking.hand_tracker import HandTracker
from .tracking.people import people_of, seen_briefly
from .tracking.scene_cuts import SceneCuts
from .tracking.search_schedule import MaskSchedule
from .tracking.track import Track, Tracklet, make_track
from .tracking.tracker import PeopleTracker

_TOLERANCE_S = 1e-6  # of a frame's time, as in decoding


class Trackers(NamedTuple):
    """The trackers of people, and of what is captured only on request."""

    people: PeopleTracker
    hands: HandTracker | None
    faces: FaceTracker | None


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


WHOLE_CLIP = Window(0, -math.inf, -math.inf, math.inf)


@dataclass
class Observed:
    """What was observed in T frames of a clip, or of a window of it, before it is decided who is
    who. The tracklets' rows count from 0.

    In a window, the first ``first`` frames belong to the window before. ``checksums`` (T,) are
    those of the images in the frames that two windows share, and 0 elsewhere. ``anchor`` is the row
    in which the trackers of the next window begin, T if there is none, and ``anchor_regions`` are
    the regions of the people in it. ``cut_rows`` are among the window's own frames.
    ``picture_changes`` (T,): see `SceneCuts`.
    """

    frames: list[int]  # (T,) source frame index
    timestamps: list[float]  # (T,) seconds
    cut_rows: list[int]  # of the frames that begin another scene
    tracklets: dict[int, Tracklet]
    background: BackgroundRecord
    execution: str = ""  # what the networks ran on, for the report
    warnings: list[Notice] = field(default_factory=list)
    window: Window = WHOLE_CLIP
    first: int = 0
    anchor: int = 0
    checksums: list[int] = field(default_factory=list)
    anchor_regions: list[Region] = field(default_factory=list)
    picture_changes: list[float] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.timestamps)

    @property
    def scene_starts(self) -> NDArray[np.int64]:
        """(M,) rows of the frames that begin another scene than the frame before."""
        return np.array([row for row in self.cut_rows if row > 0], np.int64)

    def tracks(
        self, most: int, chosen: ChosenPerson | None = None, speed: float = 1.0
    ) -> tuple[list[Track], list[ChosenPerson]]:
        """Return the tracks of at most ``most`` people, and where others are, who are left out; if
        there are fewer people, who was seen too briefly.

        :param chosen: who comes first; None: the most prominent one.
        :param speed: how many times as fast as it plays the footage was recorded, so that the gaps
            at scene cuts are `SCENE_GAP_S` of what was filmed.
        :raises UsageError: the chosen person was not found.
        """
        times_s = np.array(self.timestamps)
        cuts_s = cut_times(times_s, self.scene_starts)
        times = with_scene_gaps(times_s, cuts_s, SCENE_GAP_S * speed)
        seen = [tracklet for tracklet in self.tracklets.values() if tracklet.rows]
        in_order = sorted(seen, key=lambda tracklet: tracklet.rows[0])
        people, doubtful = people_of(times.tolist(), in_order)
        if chosen is not None and (people or doubtful):
            first = find_chosen(chosen, people, doubtful, self.timestamps)
            people = [first, *(person for person in people if person is not first)]
            doubtful = [person for person in doubtful if person is not first]
        tracks = [make_track(self.frames, times.tolist(), person) for person in people[:most]]
        others = people[most:]
        if 0 < len(people) < most:
            others = seen_briefly(people, doubtful, times.tolist())
        return tracks, [place_of(person, self.timestamps) for person in others]

    def continues(self, before: Observed) -> bool:
        """Return whether the frames that this window shares with the one before are the same images
        there.
        """
        same_times = before.timestamps[before.anchor :] == self.timestamps[: self.first]
        return same_times and before.checksums[before.anchor :] == self.checksums[: self.first]


class FrameObserver:
    """Takes the frames of a clip, or of one window from that in which its trackers begin, in order;
    none is kept.

    :param trackers: that have seen nothing.
    :param camera: as options and footage describe it.
    :param pool: in which the background is followed while the networks run on the next frame.
    :param following: the next window; None: there is none.
    """

    def __init__(
        self,
        video: Video,
        trackers: Trackers,
        camera: Camera,
        pool: ThreadPoolExecutor,
        clock: StageClock,
        window: Window = WHOLE_CLIP,
        following: Window | None = None,
    ) -> None:
        self.window = window
        self.background = BackgroundTracker(camera, video.width, video.height)
        self._following = following
        self._trackers = trackers
        self._masks = MaskSchedule(trackers.people.mask_network, video.expected_frames)
        self._pool = pool
        self._clock = clock
        self._cuts = SceneCuts(float(video.fps))
        self._exposure = AutoExposure()
        # The next frame in the brightness that the networks are given.
        self._upcoming_lit: Uint8Array | None = None
        self._background_call: Future[None] | None = None
        self._frames: list[int] = []
        self._timestamps: list[float] = []
        self._cut_rows: list[int] = []
        self._tracklets: dict[int, Tracklet] = {}
        self._first = 0
        self._anchor: int | None = None
        self._anchor_regions: list[Region] = []
        self._checksums: list[int] = []

    def add(self, frame: Frame, upcoming: Frame | None) -> list[Observation]:
        """Observe the next frame, and return its people, the largest first.

        :param upcoming: the frame after it, also if that is in the next window; None at the end of
            the clip.
        """
        time_s = frame.timestamp_s
        row = len(self._timestamps)
        is_own = self.window.has_begun(time_s)
        is_anchor = (
            self._anchor is None
            and self._following is not None
            and self._following.warms_up(time_s)
        )
        if is_anchor:
            self._anchor = row
        is_shared = not is_own or self._anchor is not None
        self._checksums.append(_checksum(frame.image_rgb) if is_shared else 0)
        self._first += not is_own
        with self._clock.stage("decode"):
            lit = self._upcoming_lit
            if lit is None:
                lit = self._exposure.brighten(frame.image_rgb)
            upcoming_rgb = None if upcoming is None else upcoming.image_rgb
            self._upcoming_lit = (
                None if upcoming_rgb is None else self._exposure.brighten(upcoming_rgb)
            )
        with self._clock.stage("networks"):
            is_cut = self._cuts.is_cut(frame.image_rgb, upcoming_rgb)
        if is_cut:
            self._trackers.people.forget()
            if is_own:
                self._cut_rows.append(row)
        observations = self._track(lit, time_s, is_own)
        self._frames.append(frame.index)
        self._timestamps.append(time_s)
        for number, observation in observations:
            self._tracklets.setdefault(number, Tracklet()).add(row, observation)
        people = [observation for _, observation in observations]
        if is_anchor:
            self._anchor_regions = [person.region for person in people]
        with self._clock.stage("background"):
            self._wait_for_background()
            self._background_call = self._pool.submit(
                self.background.add,
                frame.image_rgb,
                time_s,
                [person.keypoints_px for person in people],
                is_cut=is_cut,
                is_sampled=is_anchor,
                is_shared=is_shared,
            )
        return sorted(people, key=lambda person: -person.region.side_px)

    def observed(self, execution: str = "", warnings: Sequence[Notice] = ()) -> Observed:
        """Return what was found so far, once the background and the reference network are ready.

        :param execution: what the networks ran on.
        """
        self._wait_for_background()
        for tracklet in self._tracklets.values():
            for _, call in tracklet.references:
                call.result()
        return Observed(
            frames=list(self._frames),
            timestamps=list(self._timestamps),
            cut_rows=list(self._cut_rows),
            tracklets=self._tracklets,
            background=self.background.record(),
            execution=execution,
            warnings=list(warnings),
            window=self.window,
            first=self._first,
            anchor=len(self._timestamps) if self._anchor is None else self._anchor,
            checksums=list(self._checksums),
            anchor_regions=self._anchor_regions,
            picture_changes=list(self._cuts.changes),
        )

    def _track(
        self, lit: Uint8Array, time_s: float, with_masks: bool
    ) -> list[tuple[int, Observation]]:
        """Return tracklet number and observation of each person in a frame (H, W, 3)."""
        trackers = self._trackers
        with self._clock.stage("networks"):
            masks_are_due = with_masks and self._masks.upcoming_is_due
            observations = trackers.people.step(lit, self._upcoming_lit, time_s, masks_are_due)
            if with_masks:
                observations = self._masks.add(lit, observations)
        if trackers.hands is not None:
            with self._clock.stage("hands"):
                observations = trackers.hands.step(lit, observations, time_s)
        if trackers.faces is not None:
            with self._clock.stage("face"):
                observations = trackers.faces.step(lit, observations, time_s)
        return observations

    def _wait_for_background(self) -> None:
        if self._background_call is not None:
            self._background_call.result()


def _checksum(image_rgb: Uint8Array) -> int:
    return zlib.crc32(np.ascontiguousarray(image_rgb).data)
