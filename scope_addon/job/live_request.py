# SPDX-License-Identifier: GPL-3.0-or-later
"""The requests for a live capture and for a camera's formats, and the commands to a running live
capture.
"""

from __future__ import annotations

import json
import re
import threading
from typing import Any

from ..errors import UsageError
from ..options import Place
from .request import LineRequest, checked_values

RECORD = b"record\n"
STOP = b"stop\n"
_LONGEST = 4096  # bytes without an end of line, which is no command


class LiveRequest(LineRequest):
    """A source, whether it may be a stream, and a value for each option of `Place.LIVE_WORKER`."""

    called = "the request of a live capture"
    first_key = "live"

    def __init__(self, live: str, *, online: bool = False, **values: Any) -> None:
        """Check the values, and fill in the defaults of the others.

        :param live: camera, stream or file.
        :param online: whether the network may be used.
        :raises UsageError: an option does not exist, or its value has the wrong type or is none of
            the choices.
        """
        if not isinstance(live, str) or not isinstance(online, bool):
            raise UsageError(
                "a live capture's request needs a source, and whether the network may be used"
            )
        self.source = live
        self.online = online
        self.values: dict[str, Any] = checked_values(values, Place.LIVE_WORKER)

    def to_json(self) -> str:
        """Return the request as one line of JSON."""
        values = {
            name: str(v) if hasattr(v, "__fspath__") else v for name, v in self.values.items()
        }
        return json.dumps({"live": self.source, "online": self.online, **values})


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


class FormatsRequest(LineRequest):
    """A camera, by number or device."""

    called = "the request for a camera's formats"
    first_key = "formats_of"

    def __init__(self, formats_of: str) -> None:
        """Check it.

        :raises UsageError: it is neither.
        """
        if not isinstance(formats_of, str) or not re.fullmatch(
            r"(/dev/video)?[0-9]{1,3}", formats_of
        ):
            raise UsageError("a request for formats needs the number of a camera")
        self.source = formats_of

    def to_json(self) -> str:
        """Return the request as one line of JSON."""
        return json.dumps({"formats_of": self.source})
