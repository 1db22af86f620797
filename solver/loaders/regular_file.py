# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of a file before it is read: reading a pipe may wait forever, reading a device may never
end.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import Any

from ..arrays import described
from ..errors import InputError, InvalidValueError

_LONGEST = 200  # characters


def in_one_line(cause: Exception) -> str:
    """Return what another library said, for a message: one line of moderate length."""
    return " ".join(str(cause).split())[:_LONGEST]


def as_path(value: Any, name: str) -> Path:
    """Return the path of a file.

    :raises InvalidValueError: it is neither a text nor a path, or contains a null character.
    """
    if not isinstance(value, (str, os.PathLike)) or not isinstance(os.fspath(value), str):
        raise InvalidValueError(
            f"{name} must be a str or a pathlib.Path, but is {described(value)}."
        )
    if "\0" in os.fspath(value):  # what opens files refuses it with a plain ValueError
        raise InvalidValueError(
            f"{name} must be the name of a file, but contains a null character: "
            f"{os.fspath(value)!r}."
        )
    return Path(value)


def check_regular(path: Path, error: type[InputError], what: str, largest_bytes: int) -> None:
    """Refuse a path that is a pipe or a device, or a file that is too large. What does not exist is
    not refused.

    :param error: class of what is raised.
    :param what: what the file should be, for the message, e.g. ``motion file``.
    :param largest_bytes: size up to which a file is accepted.
    :raises InputError: as `error`, when the path is a pipe or a device, or the file is too large.
    """
    try:
        status = path.stat()
    except OSError:
        return
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        raise error(f"{path} is a pipe or a device, not a regular file; choose a {what}")
    if stat.S_ISREG(status.st_mode) and status.st_size > largest_bytes:
        raise error(
            f"{path} has {status.st_size >> 20} MiB, too large for a {what}; choose another file"
        )
