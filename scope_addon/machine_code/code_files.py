# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of machine code, which are checked before they are used.

What is trusted. A file's content is unpickled and run, so whoever can write it can run anything as
the user:

- A folder that comes with the program is trusted as the program's sources are: who can write there
    can change those.
- Anywhere else only a file of the user's own, or the system's, that nobody else may write to is
  opened, wherever it lies: a folder in which others can write, such as the system's temporary one,
  is no way in. (Windows, which keeps the user's folders from others by itself, reports no owner.)
- The checksum finds damage (a full disk, a power cut, flipped bits), which would crash the process.
  It is not a signature: it says nothing about who wrote the file.
"""

from __future__ import annotations

import hashlib
import os
import stat
from pathlib import Path

from ..atomic_write import complete_file
from ..temporary import remove

SUFFIX = ".code"
_MAGIC = b"Scope machine code 1\n"
# a named pipe must not block
_OPEN = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)


def read_code(path: Path, key: str, *, trusted: bool) -> bytes | None:
    """Return what `write_code` wrote; None if there is no such file, or none that may be used.

    A damaged file is removed, so that it is written anew.

    :param key: what the code was compiled from and for; part of the checksum, so that a renamed
        file does not pass.
    :param trusted: whether the folder came with the program.
    """
    try:
        descriptor = os.open(path, _OPEN)
    except OSError:
        return None
    try:
        with open(descriptor, "rb") as file:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode) or not (trusted or _only_ours(status)):
                return None
            content = file.read()
    except OSError:
        return None
    payload = content[len(_header(key, b"")) :]
    if content != _header(key, payload) + payload:
        remove(path)
        return None
    return payload


def write_code(path: Path, key: str, payload: bytes) -> None:
    """Write a file that is either complete or not there.

    :raises OSError: the system refused.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # Nobody else may write to it, also where new files are the group's as well: it would not be
    # read again.
    with complete_file(path, durable=False, mode=0o644) as temporary:
        temporary.write_bytes(_header(key, payload) + payload)


def _header(key: str, payload: bytes) -> bytes:
    return _MAGIC + hashlib.sha256(key.encode() + b"\n" + payload).digest()


def _only_ours(status: os.stat_result) -> bool:
    """Whether only this user or the system can have written the file."""
    if not hasattr(os, "geteuid"):
        return True
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
