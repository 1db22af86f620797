# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of a live capture as a video, from which a better motion of the same take can be
captured afterwards.

Every picture that comes is written, also those that the capture drops, at the time at which it
came. A thread encodes them; if it is too slow, pictures are left out, but neither source nor
capture waits. The file is complete or absent.
"""

from __future__ import annotations

import queue
import threading
from fractions import Fraction
from pathlib import Path
from types import TracebackType

from ....solver.errors import ScopeError
from ...atomic_write import atomic_path, reason
from ...capture.overlay.video_writer import VideoWriter
from ...counts import counted
from ...errors import OutputError
from ..sources import Picture

_WAITING = 16  # pictures; at 720p, 44 MB


class Footage:
    """A context in which a video is written; `save` ends it, and leaving it otherwise writes
    nothing.
    """

    def __init__(self, path: Path, fps: Fraction) -> None:
        self._path = path
        self._fps = fps
        self.origin: tuple[int, float] | None = None  # number and time of the first picture
        self.lost = 0  # pictures that were left out
        self._size: tuple[int, ...] = ()
        self._waiting: queue.Queue[Picture | None] = queue.Queue(_WAITING)
        self._is_wanted = True
        self._problem = ""
        self._thread = threading.Thread(target=self._run, name="scope-live-footage", daemon=True)

    def add(self, picture: Picture) -> None:
        """Add a picture, from the thread that reads the source."""
        if self.origin is None:
            self._size = picture.image_rgb.shape
            self.origin = picture.index, picture.timestamp_s
            self._thread.start()
        try:
            if picture.image_rgb.shape != self._size:  # after a reconnection; a video has one size
                raise queue.Full
            self._waiting.put_nowait(picture)
        except queue.Full:
            self.lost += 1

    @property
    def missing(self) -> str:
        """Say how many pictures were left out; empty if none were."""
        if not self.lost:
            return ""
        return f"{counted(self.lost, 'frame')} {'is' if self.lost == 1 else 'are'} missing"

    def save(self) -> Path | None:
        """Finish the file; None if no picture came.

        :raises OutputError: it cannot be written.
        """
        if self.origin is None:
            return None
        self._end()
        if self._problem:
            raise OutputError(self._problem)
        return self._path

    def __enter__(self) -> Footage:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: object, trace: TracebackType | None
    ) -> None:
        self._is_wanted = False
        if self.origin is not None:
            self._end()

    def _end(self) -> None:
        while self._thread.is_alive():  # a full queue empties, unless writing has failed
            try:
                self._waiting.put(None, timeout=0.1)
                break
            except queue.Full:
                continue
        self._thread.join()

    def _run(self) -> None:
        try:
            with atomic_path(self._path) as temporary:
                self._write(temporary)
        except ScopeError as error:
            self._problem = str(error)
        except OSError as error:
            self._problem = f"cannot write {self._path} ({reason(error)})"

    def _write(self, temporary: Path) -> None:
        # as the encoder needs it
        height = self._size[0] // 2 * 2
        width = self._size[1] // 2 * 2
        assert self.origin is not None
        with VideoWriter(temporary, self._fps, width, height, self._path) as writer:
            while (picture := self._waiting.get()) is not None and self._is_wanted:
                writer.write(
                    picture.image_rgb[:height, :width], picture.timestamp_s - self.origin[1]
                )
            if not self._is_wanted:
                raise OutputError(f"{self._path} is not written, since the capture failed")
