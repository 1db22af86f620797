# SPDX-License-Identifier: GPL-3.0-or-later
"""Asking a camera for its formats, in a process of its own that ends with the answer, or when it
takes too long.

On Windows and macOS, FFmpeg loads the camera's driver for it, whose defects then end that process
and nothing else.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path

from ...errors import UsageError
from ...temporary import temporary_folder
from ..messages import WARM_UP_FIELDS, Fields, WorkerFailedError
from ..process import START_SCRIPT, WorkerProcess
from .cameras import LONGEST_NAME, Camera, camera_number, camera_source
from .formats_request import FormatsRequest

ANSWER_S = 20.0  # for an answer, and for the user's to the system's question
_MAX_FORMATS = 64  # formats
_INTERVAL_S = 0.02


def _is_shown(value: object) -> bool:
    return isinstance(value, str) and 0 < len(value) <= LONGEST_NAME and value.isprintable()


def _are_formats(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) <= _MAX_FORMATS
        and all(_is_shown(text) for text in value)
    )


_FIELDS: Fields = {
    "progress": WARM_UP_FIELDS["progress"],
    "result": {"name": _is_shown, "formats": _are_formats},
}


class FormatsProcess(WorkerProcess):
    """The question to one camera. Call ``answer`` regularly; ``close`` ends the process at once."""

    def __init__(
        self, source: str, job_folder: Path, python: Sequence[str], script: Path = START_SCRIPT
    ) -> None:
        """Start the process; see `WorkerProcess`.

        :param source: as `camera_source` gives it.
        :raises SetupError: the process cannot be started.
        """
        self.source = source
        self._began_s = time.monotonic()
        super().__init__(FormatsRequest(source), job_folder, None, python, script)
        self._fields = _FIELDS

    def answer(self) -> Camera | None:
        """Return the camera with its formats; None as long as there is no answer.

        :raises WorkerFailedError: there will be none.
        """
        for message in self.poll():
            if message["event"] == "result":
                return Camera(
                    camera_number(self.source), message["name"], tuple(message["formats"])
                )
        if time.monotonic() - self._began_s > ANSWER_S:
            raise WorkerFailedError(
                f"camera {self.source} has not reported its formats within {ANSWER_S:.0f} s; if "
                "the system asks "
                "for permission to use it, answer, and try again"
            )
        return None

    def _cause_of_end(self) -> str:
        return (
            f"camera {self.source} cannot be asked for its formats; check that it is plugged in, "
            "and that this program"
            " may use cameras"
        )


def ask_for_formats(text: str) -> Camera:
    """Return a camera with its formats, waiting for the answer.

    :param text: number or device.
    :raises UsageError: it is not a camera.
    :raises ScopeError: there is no answer.
    """
    source = camera_source(text)
    if source is None:
        said = "a stream" if "://" in text else text
        raise UsageError(f"{said} is not a camera; give its number, 0 for the first")
    with temporary_folder("formats") as folder:
        process = FormatsProcess(source, folder, [sys.executable])
        try:
            while (camera := process.answer()) is None:
                time.sleep(_INTERVAL_S)
        finally:
            process.close()
    return camera
