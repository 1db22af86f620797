# SPDX-License-Identifier: GPL-3.0-or-later
"""A video that is played in real time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ...capture.media.video import open_video
from ..clock import Clock
from .source import Picture

# by which a frame is too late after a computer has slept: what it slept through is not made up for
LEAP_S = 2.0


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
