# SPDX-License-Identifier: GPL-3.0-or-later
"""The cameras of this computer with their names and formats.

On Linux from sysfs and Video4Linux, elsewhere as FFmpeg lists them, by DirectShow or AVFoundation,
where a camera's number is its place in this list. Reading them does not switch a camera on.
Elsewhere than on Linux, the list has no formats: for these, FFmpeg has to open a camera, which is
done for one camera, in a process of its own that ends with the answer, or when it takes too long.
FFmpeg loads the camera's driver for it, whose defects then end that process and nothing else.
"""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ..errors import UsageError, VideoError
from ..live.system_cameras import camera_names, camera_with_modes, described
from ..live.video4linux import MAX_FORMATS, delivers_images, pixel_formats
from ..temporary import temporary_folder
from .process import PROGRESS_FIELDS, START_SCRIPT, WorkerFailedError, WorkerProcess
from .request import FormatsRequest

NAMES = Path("/sys/class/video4linux")
DEVICES = Path("/dev")
LONGEST_NAME = 60  # characters
_MAX_CAMERAS = 64
ANSWER_S = 20.0  # for an answer, and for the user's to the system's question
_MAX_ANSWERED_FORMATS = 64  # formats
_INTERVAL_S = 0.02


@dataclass(frozen=True)
class ListedCamera:
    """A camera: its number, its name as it tells it, and what it offers, such as ``MJPG
    1920×1080``.
    """

    number: int
    name: str
    formats: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """A line for a list, which begins with the number."""
        return f"{self.number}: {self.name}" + (
            f" ({', '.join(self.formats)})" if self.formats else ""
        )


def list_cameras() -> list[ListedCamera]:
    """Return the cameras in the order of their numbers; what cannot be read is left out."""
    if not sys.platform.startswith("linux"):
        return [
            ListedCamera(number, _shown(name))
            for number, name in enumerate(camera_names(sys.platform)[:_MAX_CAMERAS])
        ]
    with suppress(OSError):
        numbers = sorted(
            int(m[1])
            for entry in os.listdir(NAMES)
            if (m := re.fullmatch(r"video(\d{1,3})", entry))
        )
        found = map(_camera, numbers[:_MAX_CAMERAS])
        return [camera for camera in found if camera is not None]
    return []


def camera_with_formats(source: str) -> ListedCamera:
    """Return a camera with its formats, for which it is opened on Windows and macOS: not in
    Blender's process.

    :param source: as `camera_source` gives it.
    :raises VideoError: it does not exist.
    """
    number = camera_number(source)
    if sys.platform.startswith("linux"):
        for camera in list_cameras():
            if camera.number == number:
                return camera
        raise VideoError(
            f"camera {number} does not exist; connect a camera, or choose a stream or a file"
        )
    name, modes = camera_with_modes(number, sys.platform)
    return ListedCamera(
        number, _shown(name), tuple(_shown(text) for text in described(modes)[:MAX_FORMATS])
    )


def camera_source(text: str) -> str | None:
    """Return the number or device that a text begins with, which may be a label; None if it is not
    a camera.
    """
    match = re.match(r"(\d{1,3}|/dev/video\d{1,3})\s*(?::.*)?$", text.strip(), re.S | re.ASCII)
    return match[1] if match else None


def camera_number(source: str) -> int:
    """Return the number of what `camera_source` gives."""
    return int(source.removeprefix("/dev/video"))


def _camera(number: int) -> ListedCamera | None:
    """Return a camera; None for a node that gives no pictures, such as that of a camera's
    metadata.
    """
    try:
        shown = _printable((NAMES / f"video{number}" / "name").read_bytes())
    except OSError:
        shown = "camera"
    formats: tuple[str, ...] = ()
    with suppress(OSError):  # it is in use, or this user may not open it
        node = os.open(DEVICES / f"video{number}", os.O_RDWR | os.O_NONBLOCK)
        try:
            if not delivers_images(node):
                return None
            formats = tuple(
                _printable(code) + (f" {size[0]}×{size[1]}" if size else "")
                for code, size in pixel_formats(node)
            )
        finally:
            os.close(node)
    return ListedCamera(number, shown, formats)


def _printable(name: bytes) -> str:
    """Return a device's text as `_shown`."""
    return _shown(name.decode("utf-8", "replace"))


def _shown(name: str) -> str:
    """Return a text without what could disturb a list: control and formatting characters, great
    length.
    """
    text = "".join(c for c in name if c.isprintable())
    return text.strip()[:LONGEST_NAME] or "camera"


def _is_shown(value: object) -> bool:
    return isinstance(value, str) and 0 < len(value) <= LONGEST_NAME and value.isprintable()


def _are_formats(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) <= _MAX_ANSWERED_FORMATS
        and all(_is_shown(text) for text in value)
    )


class FormatsProcess(WorkerProcess):
    """The question to one camera. Call ``answer`` regularly; ``close`` ends the process at once."""

    fields = PROGRESS_FIELDS | {"result": {"name": _is_shown, "formats": _are_formats}}

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

    def answer(self) -> ListedCamera | None:
        """Return the camera with its formats; None as long as there is no answer.

        :raises WorkerFailedError: there will be none.
        """
        for message in self.poll():
            if message["event"] == "result":
                return ListedCamera(
                    camera_number(self.source), message["name"], tuple(message["formats"])
                )
        if time.monotonic() - self._began_s > ANSWER_S:
            raise WorkerFailedError(
                f"camera {self.source} has not reported its formats within {ANSWER_S:.0f} s; if "
                "the system asks for permission to use it, answer, and try again"
            )
        return None

    def _cause_of_end(self) -> str:
        return (
            f"camera {self.source} cannot be asked for its formats; check that it is plugged in, "
            "and that this program may use cameras"
        )


def ask_for_formats(text: str) -> ListedCamera:
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
