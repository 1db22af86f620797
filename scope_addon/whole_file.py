# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are written whole or not at all: beside their place, and renamed into it."""

from __future__ import annotations

import contextlib
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
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}.", suffix=path.suffix.lower(), dir=path.parent)
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


def remove_unfinished() -> None:
    """Remove what is being written; for a process that is about to leave without any of its exits."""
    for temporary in list(_unfinished):
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
