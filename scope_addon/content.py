# SPDX-License-Identifier: GPL-3.0-or-later
"""What is in a file, as a hash that takes a bounded time; when it was written. Standard library
only.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

_PIECE_BYTES = 1 << 20


def add_content(digest: hashlib._Hash, path: Path, most_bytes: int) -> None:
    """Add the size and the content of a file to a hash.

    Of a file of more than ``most_bytes``, it is evenly spread pieces, with the first and the last.

    What is no regular file, such as a pipe, counts by its kind.

    :raises OSError: it cannot be read.
    """
    status = path.stat()
    size = status.st_size
    digest.update(f"{stat.S_IFMT(status.st_mode)} {size} ".encode())
    if not stat.S_ISREG(status.st_mode):
        return
    piece_bytes = min(_PIECE_BYTES, max(1, most_bytes // 2))
    with path.open("rb") as file:
        if size <= most_bytes:
            while piece := file.read(_PIECE_BYTES):
                digest.update(piece)
            return
        pieces = max(2, most_bytes // piece_bytes)
        for k in range(pieces):
            file.seek(k * (size - piece_bytes) // (pieces - 1))
            digest.update(file.read(piece_bytes))


def state_of(path: Path) -> tuple[int, ...]:
    """Return what differs when a file is replaced or written: its identity, size and time; empty if
    it is not there.

    :raises OSError: that cannot be seen, as where a server is gone.
    """
    try:
        status = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return ()
    return (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)


def size_and_time(path: Path) -> tuple[int, ...]:
    """Return those of a file; some file systems change its number by themselves. Empty if it cannot
    be seen, which whoever reads or writes it says.
    """
    try:
        return state_of(path)[2:]
    except OSError:
        return ()


def newest_first(paths: Iterable[Path]) -> list[Path]:
    """Return paths, what was changed last first, without what is removed meanwhile."""
    times: dict[Path, float] = {}
    for path in paths:
        with suppress(OSError):
            times[path] = path.stat().st_mtime
    return sorted(times, key=times.__getitem__, reverse=True)
