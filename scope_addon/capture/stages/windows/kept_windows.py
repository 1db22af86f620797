# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows of a long clip that are finished, on disk so that a capture that was killed goes on after them.

They depend on the footage, the program and the options. The caller's folder is one of this footage and this program;
within it, each set of options has a folder of its own.
"""

from __future__ import annotations

import hashlib
from contextlib import suppress
from dataclasses import fields
from pathlib import Path

from .....solver.errors import ScopeError
from ...options import CaptureOptions
from ...perception.adapters.description import description_path
from .plan import Window
from .window_file import load_window, save_window, window_name
from .window_record import WindowRecord

LARGEST = 1 << 30  # bytes of one capture's windows
_UNIMPORTANT = ("threads",)  # options with which the result is the same, bit for bit


class KeptWindows:
    """The files of finished windows. What cannot be read or written is not kept: nothing depends on it but time.

    :param unfinished: folder of the capture, need not exist; None: nothing is kept.
    :param size: of the image, width and height in pixels.
    """

    def __init__(self, unfinished: Path | None, options: CaptureOptions, size: tuple[int, int]) -> None:
        self._folder = None if unfinished is None else unfinished / f"windows-{_digest(options)}"
        self._size, self._bytes = size, 0

    def load(self, window: Window) -> WindowRecord | None:
        """Return what was observed in a window; None if that is not known."""
        if self._folder is None:
            return None
        with suppress(OSError):
            self._bytes += (self._folder / window_name(window.number)).stat().st_size
        return load_window(self._folder, window, self._size)

    def save(self, record: WindowRecord) -> None:
        """Keep a window; after a failure, or when there is too much, none any more."""
        if self._folder is None:
            return
        try:
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._bytes += save_window(self._folder, record, self._size).stat().st_size
        except (OSError, ScopeError):
            self._folder = None
        if self._bytes > LARGEST:
            self._folder = None


def _digest(options: CaptureOptions) -> str:
    """Return a name that differs where options, or the files that they name, may lead to another result."""
    described = []
    for field in fields(options):
        if field.name in _UNIMPORTANT:
            continue
        value = getattr(options, field.name)
        described.append(f"{field.name}={value!r}")
        if isinstance(value, Path):
            described += map(_state, (value, description_path(value)))
    return hashlib.sha256("\n".join(described).encode("utf-8", "surrogateescape")).hexdigest()[:32]


def _state(path: Path) -> str:
    """Return what changes with a file."""
    try:
        status = path.stat()
        return f"{path.resolve()} {status.st_size} {status.st_mtime_ns}"
    except OSError:
        return ""
