# SPDX-License-Identifier: GPL-3.0-or-later
"""The loop of a live capture: the newest frame in, a pose out to everybody who listens, until the
source or user ends; and how fast and how late the poses come.

Networks and solver are loaded before the source is opened. The first pose takes longer than the
others, because it includes the first estimates of focal length, shape and floor.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ...solver import Body
from ..capture.camera.intrinsics import assumed_camera, choose_camera
from ..capture.fitting.live_body import LiveBody
from ..capture.fitting.stature import require_stature
from ..capture.media.frame import Frame
from ..capture.media.video import opencv_in_one_thread
from ..capture.observe import network_threads
from ..capture.perception.sessions import Execution
from ..capture.tracking.tracker import PeopleTracker
from .camera import CAMERA_SIZE
from .newest_frame import NewestFrame
from .people import LivePeople
from .pose import LivePose, Presence
from .source import Clock, Picture, Source

PROGRESS_S = 0.5  # between two lines of progress
RECENT_S = 2.0  # over which the rate is shown
MAX_LATENCIES = 100_000  # the last hour at 28 poses/s


@dataclass(frozen=True)
class LiveOptions:
    """How to capture; see the options of the command line."""

    quality: str = "fast"
    people: int = 1
    heights_m: tuple[float, ...] = ()
    focal_mm: float | None = None
    fov_deg: float | None = None
    calibration: Path | None = None
    threads: int = 0
    provider: str = "auto"
    reconnect_s: float = 2.0

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> LiveOptions:
        """Return the options from their values by name, as the command line and a request have
        them.
        """
        return cls(
            quality=values["live_quality"],
            people=values["live_people"],
            heights_m=tuple(values["heights_m"]),
            focal_mm=values["focal_mm"],
            fov_deg=values["fov_deg"],
            calibration=Path(values["calibration"]) if values["calibration"] else None,
            threads=values["threads"],
            provider=values["provider"],
            reconnect_s=values["reconnect_s"],
        )


class Output(Protocol):
    """Takes poses, and must not delay the capture."""

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Take a pose whose frame came ``latency_ms`` ago."""


@dataclass(frozen=True)
class LiveProgress:
    """The state of a capture; rates per second over the last seconds, latencies in milliseconds."""

    presence: Presence  # of the first person, by whom camera and floor are estimated
    rate: float
    median_ms: float
    p95_ms: float
    dropped: int
    received: int
    damaged: int = 0  # left out, and not among those received

    def __str__(self) -> str:
        """Return a line for a terminal."""
        return (
            f"{self.presence.value}, {self.rate:.1f} poses/s, latency {self.median_ms:.0f} ms"
            f" (p95 {self.p95_ms:.0f} ms), {self.dropped} of {self.received} frames dropped"
            + (f", {self.damaged} damaged" if self.damaged else "")
        )


@dataclass(frozen=True)
class Listeners:
    """Callbacks of a live capture: ``say`` gets sentences, ``progress`` the state of the capture,
    from time to time.
    """

    say: Callable[[str], None] = lambda _: None
    progress: Callable[[LiveProgress], None] = lambda _: None
    # once the first frame has come
    camera: Callable[[LivePeople, tuple[int, int]], None] = lambda *_: None
    # every frame, from another thread, which must not be delayed
    received: Callable[[Picture], None] = lambda _: None


def run_live(
    source: Source,
    body: Body,
    options: LiveOptions,
    outputs: Sequence[Output],
    listeners: Listeners,
    clock: Clock | None = None,
) -> dict[str, Any]:
    """Capture until the source ends, the clock is stopped, or a KeyboardInterrupt comes; return the
    report.

    :raises ScopeError: an option is invalid, the source cannot be read, or an output failed.
    """
    for height_m in options.heights_m:
        require_stature(body, height_m)
    clock = clock or Clock()
    execution = Execution(options.provider)
    people = options.people if options.people > 1 else None  # None: the largest one
    tracker = PeopleTracker(
        options.quality, network_threads(options.threads, execution), people, execution=execution
    )
    for warning in execution.warnings:  # fewer cores than threads, or a provider that fell back
        listeners.say(str(warning))
    LiveBody(body, assumed_camera(*CAMERA_SIZE, CAMERA_SIZE)).load()
    statistics = Statistics()
    reader = NewestFrame(source, clock, options.reconnect_s, listeners.say, listeners.received)
    stopped = False
    with (
        ThreadPoolExecutor(1, "scope-live-calibration") as executor,
        opencv_in_one_thread(),
        reader,
    ):
        try:
            _loop(
                reader,
                _Poses(source, body, options, tracker, executor, listeners, clock),
                outputs,
                statistics,
                listeners,
            )
        except KeyboardInterrupt:
            stopped = True
        finally:
            executor.shutdown(wait=False, cancel_futures=True)
    median_ms, p95_ms = statistics.latency_ms()
    return {
        "source": source.name,
        "frames": reader.received,
        "dropped": reader.received - statistics.poses,
        "damaged": reader.damaged,
        "poses": statistics.poses,
        "poses_per_second": round(statistics.rate, 1),
        "latency_ms": {"median": round(median_ms, 1), "p95": round(p95_ms, 1)},
        "stopped": stopped,
    }


@dataclass
class _Poses:
    """Opens sessions for the size of the frames, and other ones where that changes, as after a
    reconnection.
    """

    source: Source
    body: Body
    options: LiveOptions
    tracker: PeopleTracker
    executor: ThreadPoolExecutor
    listeners: Listeners
    clock: Clock
    _size: tuple[int, int] | None = None
    _people: LivePeople | None = None

    def of(self, picture: Picture) -> list[LivePose]:
        """Return the poses in a picture."""
        height, width = picture.image_rgb.shape[:2]
        if self._people is None or self._size != (width, height):
            is_first = self._people is None
            options = self.options
            camera = choose_camera(
                width,
                height,
                focal_mm=options.focal_mm,
                fov_deg=options.fov_deg,
                calibration=options.calibration,
                metadata_focal_mm=self.source.focal_35mm,
            )
            self._size = width, height
            self.tracker.reset()
            self._people = LivePeople(
                self.body,
                self.tracker,
                camera,
                self._size,
                heights_m=options.heights_m,
                count=options.people,
                executor=self.executor,
            )
            self.listeners.camera(self._people, self._size)  # which may end the capture
            if not is_first:
                self._say_another_shape(width, height)
        return self._people.step(Frame(picture.index, picture.timestamp_s, picture.image_rgb))

    def _say_another_shape(self, width: int, height: int) -> None:
        if self.clock.stopped.is_set():
            consequence = "the capture ends with the image before"
        else:
            consequence = (
                "body, lens and floor are estimated again, and a recording ends with the image "
                "before"
            )
        self.listeners.say(
            f"{self.source.name} now delivers images of another shape ({width} × {height}): "
            f"{consequence}"
        )


def _loop(
    reader: NewestFrame,
    poses: _Poses,
    outputs: Sequence[Output],
    statistics: Statistics,
    listeners: Listeners,
) -> None:
    shown_s = -PROGRESS_S
    while (picture := reader.take()) is not None:
        found = poses.of(picture)
        now_s = reader.now()
        latency_ms = statistics.add(picture.arrived_s, now_s)
        for output in outputs:
            for pose in found:
                output.send(pose, latency_ms)
        if now_s - shown_s >= PROGRESS_S:
            shown_s = now_s
            median_ms, p95_ms = statistics.latency_ms()
            rate = statistics.recent_rate
            counts = (reader.received - statistics.poses, reader.received, reader.damaged)
            listeners.progress(LiveProgress(found[0].presence, rate, median_ms, p95_ms, *counts))


class Statistics:
    """Counts poses; times are seconds of the capture's clock."""

    def __init__(self) -> None:
        self._given: deque[float] = deque()
        self._latencies: deque[float] = deque(maxlen=MAX_LATENCIES)
        self.poses = 0
        self._first_s = self._last_s = 0.0

    def add(self, arrived_s: float, now_s: float) -> float:
        """Count a pose and return its latency in milliseconds.

        :param arrived_s: when its frame came, or was due.
        :param now_s: when the pose was known.
        """
        self._first_s = self._first_s if self.poses else now_s
        self._last_s = now_s
        self.poses += 1
        self._given.append(now_s)
        while self._given[0] < now_s - RECENT_S:
            self._given.popleft()
        latency_ms = 1000 * (now_s - arrived_s)
        self._latencies.append(latency_ms)
        return latency_ms

    @property
    def recent_rate(self) -> float:
        """Poses per second in the last seconds."""
        length = self._given[-1] - self._given[0] if len(self._given) > 1 else 0.0
        return (len(self._given) - 1) / length if length > 0 else 0.0

    @property
    def rate(self) -> float:
        """Poses per second since the first one."""
        length = self._last_s - self._first_s
        return (self.poses - 1) / length if length > 0 else 0.0

    def latency_ms(self) -> tuple[float, float]:
        """Return the median and the 95th percentile in milliseconds; zeros before the first
        pose.
        """
        if not self._latencies:
            return 0.0, 0.0
        median, p95 = np.percentile(self._latencies, [50, 95])
        return float(median), float(p95)
