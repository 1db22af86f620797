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

import numpy as np
from numpy.typing import NDArray

from ..capture.media.video import open_video

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
    image_rgb: NDArray[np.uint8]


class Source(Protocol):
    """A source of frames that can be opened again."""

    name: str  # for messages and the motion file
    # whether the end of its frames is the end of the capture, rather than an interruption
    ends: bool
    fps: Fraction  # nominal
    focal_35mm: float | None

    def pictures(self, clock: Clock) -> Iterator[Picture | None]:
        """Open the source and yield its frames as they come; their number begins with 0, their time
        anywhere.

        None stands for a frame that was damaged on its way and is left out.

        :raises VideoError: the source cannot be opened, or fails.
        """


class FileSource:
    """A video, played at its own speed."""

    ends = True

    def __init__(self, path: Path) -> None:
        """Check the file.

        :raises VideoError: it cannot be used.
        """
        self._path = path
        self.name = path.name
        with open_video(path) as video:
            self.fps = video.fps
            self.focal_35mm = video.focal_35mm

    def pictures(self, clock: Clock) -> Iterator[Picture]:
        """See `Source`."""
        with open_video(self._path) as video:
            began_s = clock.now()
            for frame in video:
                due_s = began_s + frame.timestamp_s
                clock.sleep(due_s - clock.now())
                if (late_s := clock.now() - due_s) > LEAP_S:
                    began_s = began_s + late_s
                    due_s = due_s + late_s
                yield Picture(
                    frame.index, frame.timestamp_s, max(due_s, clock.now()), frame.image_rgb
                )


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
