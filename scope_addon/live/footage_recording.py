# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of a live capture as a video, from which a better motion of the same take can be
captured afterwards.

Every picture that comes is written, also those that the capture drops, at the time at which it
came. A thread encodes them; if it is too slow, pictures are left out, but neither source nor
capture waits. The file grows beside its final name, ``NAME.unfinished.mp4``, and can be read
whatever ends the capture; it gets its name when it is whole.
"""

from __future__ import annotations

import os
import queue
import threading
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

from ...solver.errors import ScopeError
from ..atomic_write import create_new, finish, reason
from ..capture.media.video_writer import VideoWriter
from ..errors import OutputError
from ..notices import counted
from ..temporary import remove
from .source import Picture
from .unfinished import Target, unfinished_video

_WAITING = 16  # pictures; at 720p, 44 MB


class FootageRecording:
    """A video that is being written; `save` ends it."""

    def __init__(self, path: Path, fps: Fraction) -> None:
        self._path = path
        self._target = Target(path)
        self._fps = fps
        self.origin: tuple[int, float] | None = None  # number and time of the first picture
        # Pictures that were left out: those that could not be encoded in time, and those of another
        # size than the first one, as after a reconnection or of a phone that was turned.
        self.lost = 0
        self.resized = 0
        self.unfinished: Path | None = None  # the growing file
        self._size: tuple[int, ...] = ()
        self._waiting: queue.Queue[Picture | None] = queue.Queue(_WAITING)
        self._problem = ""
        self._thread = threading.Thread(target=self._run, name="scope-live-footage", daemon=True)

    def add(self, picture: Picture) -> None:
        """Add a picture, from the thread that reads the source."""
        if self.origin is None:
            self._size = picture.image_rgb.shape
            self.origin = picture.index, picture.timestamp_s
            try:
                self.unfinished = create_new(unfinished_video(self._path))
            except OSError as error:
                self._problem = f"cannot write {self._path}: {reason(error)}"
            else:
                self._thread.start()
        if self._problem:
            return
        if picture.image_rgb.shape != self._size:
            self.resized += 1
            return
        try:
            self._waiting.put_nowait(picture)
        except queue.Full:
            self.lost += 1

    @property
    def missing(self) -> str:
        """Say how many pictures were left out, and why; empty if none were."""
        reasons = {
            "for which the computer was too busy": self.lost,
            "of another size than the first one, which a video cannot hold": self.resized,
        }
        lacks = [f"{counted(count, 'frame')} {why}" for why, count in reasons.items() if count]
        return f"{self._path} lacks {' and '.join(lacks)}" if lacks else ""

    def save(self) -> Path | None:
        """Finish the file; None if no picture came.

        :raises OutputError: it cannot be written; says where the pictures until then are.
        """
        if self.origin is None:
            return None
        while self._thread.is_alive():  # a full queue empties, unless writing has failed
            with suppress(queue.Full):
                self._waiting.put(None, timeout=0.1)
                break
        if self.unfinished is not None:
            self._thread.join()
        if not self._problem and self.unfinished is not None:
            try:
                self._target.check()
                finish(self.unfinished, self._path)
            except OSError as error:
                self._problem = f"cannot write {self._path}: {reason(error)}"
            except OutputError as error:
                self._problem = str(error)
        if self._problem:
            raise OutputError(self._problem + self._kept())
        self.unfinished = None
        return self._path

    def _kept(self) -> str:
        """Say where the pictures are that were written; remove a file without any."""
        if self.unfinished is None or not os.path.exists(self.unfinished):  # its folder is gone
            return ""
        if self.unfinished.stat().st_size == 0:
            remove(self.unfinished)
            return ""
        return f"; the images until then are in {self.unfinished}"

    def _run(self) -> None:
        try:
            self._write()
        except ScopeError as error:
            self._problem = str(error)
        except OSError as error:
            self._problem = f"cannot write {self._path}: {reason(error)}"

    def _write(self) -> None:
        # the encoder needs even sides
        height = self._size[0] // 2 * 2
        width = self._size[1] // 2 * 2
        assert self.origin is not None
        assert self.unfinished is not None
        with VideoWriter(
            self.unfinished, self._fps, width, height, self._path, growing=True
        ) as writer:
            while (picture := self._waiting.get()) is not None:
                writer.write(
                    picture.image_rgb[:height, :width], picture.timestamp_s - self.origin[1]
                )
