# SPDX-License-Identifier: GPL-3.0-or-later
"""What every source of frames is, the frames that it gives, the clock that it runs by, and the
simplest of them: a video that is played in real time.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Protocol

from ..arrays import Uint8Array
from ..capture.media.video import open_video
from ..notices import OTHER, Notice, notice

DEFAULT_FPS = Fraction(30)
# by which a frame is too late after a computer has slept: what it slept through is not made up for
LEAP_S = 2.0


@dataclass(frozen=True)
class Picture:
    """One frame: its index and time in the source, when it came (seconds of the clock), and the (H,
    W, 3) RGB image.
    """

    index: int
    timestamp_s: float
    arrived_s: float
    image_rgb: Uint8Array


class Source(Protocol):
    """A source of frames that can be opened again."""

    name: str  # for messages and the motion file
    # whether the end of its frames is the end of the capture, rather than an interruption
    ends: bool = False
    fps: Fraction = DEFAULT_FPS  # nominal
    focal_35mm: float | None = None
    speed: float = 1.0  # how many times as fast as it plays everything happened
    warnings: list[Notice]  # which grows while it is read

    def pictures(self, clock: Clock) -> Iterator[Picture | None]:
        """Open the source and yield its frames as they come; their number begins with 0, their time
        anywhere.

        None stands for a frame that was damaged on its way and is left out.

        :raises VideoError: the source cannot be opened, or fails.
        """


class FileSource(Source):
    """A video, played at the speed at which everything happened."""

    ends = True

    def __init__(self, path: Path) -> None:
        """Check the file.

        :raises VideoError: it cannot be used.
        """
        self._path = path
        self.name = path.name
        with open_video(path) as video:
            self.speed = video.recorded_speed
            self.fps = video.fps * Fraction(self.speed).limit_denominator(1000)
            self.focal_35mm = video.focal_35mm
            self.warnings = video.warnings
        if self.speed != 1.0:
            self.warnings.append(
                notice(
                    OTHER,
                    text=f"{self.name} was recorded {self.speed:g} times as fast as it plays, so "
                    "it is played at the speed of what happened",
                )
            )

    def pictures(self, clock: Clock) -> Iterator[Picture]:
        """See `Source`."""
        with open_video(self._path) as video:
            video.warnings = self.warnings
            playback = Playback(clock)
            for frame in video:
                time_s = frame.timestamp_s / self.speed
                due_s = playback.wait(time_s)
                if playback.is_slow:
                    self._warn_once(
                        f"this computer cannot read {self.name} as fast as it plays, so it runs in "
                        "slow motion; convert it to 720p"
                    )
                yield Picture(frame.index, time_s, due_s, frame.image_rgb)

    def _warn_once(self, text: str) -> None:
        warning = notice(OTHER, text=text)
        if warning not in self.warnings:
            self.warnings.append(warning)


class Playback:
    """Shows frames at their own times, however fast they can be read.

    What a computer sleeps through, or cannot read in time, is not made up for: it goes on where it
    was.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._began_s: float | None = None  # when the footage's time 0 was, by the clock
        self._given_s = 0.0  # when the last frame was
        self.is_slow = False  # whether it fell behind without a sleep

    def wait(self, time_s: float) -> float:
        """Wait until a frame is due, and return when that was, by the clock.

        :param time_s: of the frame, in the footage.
        """
        if self._began_s is None:
            self._began_s = self._clock.now() - time_s
        due_s = self._began_s + time_s
        self._clock.sleep(due_s - self._clock.now())
        now_s = self._clock.now()
        late_s = now_s - due_s
        if late_s > LEAP_S:
            self.is_slow = self.is_slow or now_s - self._given_s < LEAP_S
            self._began_s += late_s
            due_s = now_s
        self._given_s = now_s
        return due_s


class Clock:
    """Monotonic seconds, and sleep that ends early when the capture stops."""

    def __init__(self) -> None:
        self.stopped = threading.Event()

    def now(self) -> float:
        """Return the time in seconds since an arbitrary moment."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait, but not after ``stopped`` is set."""
        if seconds > 0:
            self.stopped.wait(seconds)
