# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands from the parent to a running live capture: lines on its standard input."""

from __future__ import annotations

import threading

RECORD = b"record\n"
STOP = b"stop\n"
_LONGEST = 4096  # bytes without an end of line, which is no command


class Commands:
    """The commands so far. ``receive`` may be called from another thread."""

    def __init__(self) -> None:
        self.recording = threading.Event()
        self.stopped = threading.Event()
        self._unfinished = b""

    def receive(self, piece: bytes) -> None:
        """Take what was written, in any pieces; lines that are no command are ignored."""
        *lines, self._unfinished = (self._unfinished + piece).split(b"\n")
        self._unfinished = self._unfinished[-_LONGEST:]
        for line in lines:
            if line + b"\n" == RECORD:
                self.recording.set()
            elif line + b"\n" == STOP:
                self.stopped.set()
