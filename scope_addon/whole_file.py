# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are written whole or not at all: beside their place, and renamed into it; and why one could not be."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_unfinished: set[Path] = set()


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """An empty file in the folder of ``path``, renamed to it at the end, removed if anything fails or stops it.

    The writer may remove or replace it, but has to leave a file of that name.

    :raises OSError: it cannot be made or renamed.
    """
    start = path.stem[:40]  # whatever its letters take, room is left for the rest
    handle, name = tempfile.mkstemp(prefix=f".{start}.", suffix=path.suffix.lower(), dir=path.parent)
    temporary = Path(name)
    _unfinished.add(temporary)
    try:
        os.close(handle)
        yield temporary
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
        _unfinished.discard(temporary)


def reason(error: OSError) -> str:
    """Why a file could not be written, and what to do."""
    if error.errno == errno.ENAMETOOLONG:
        return f"{error.strerror}; choose a shorter name"
    if error.errno == errno.ENOENT:
        return "its folder does not exist; create it or choose another"
    return f"{error.strerror or error}; free some space or choose another folder"


def remove_unfinished() -> None:
    """Remove what is being written; for a process that is about to leave without any of its exits."""
    for temporary in list(_unfinished):
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
