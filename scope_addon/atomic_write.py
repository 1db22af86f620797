# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are written whole or not at all: beside their place, and renamed into it; and why one could not be."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import OutputError

_unfinished: set[Path] = set()


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """An empty file in the folder of ``path``, renamed to it at the end, removed if anything fails or stops it.

    Where ``path`` is a link, what it leads to is written, and the link stays. The writer may remove or replace the
    empty file, but has to leave a file of that name.

    :raises OSError: it cannot be made or renamed. :raises OutputError: what is there is no ordinary file.
    """
    target = resolve_link(path)
    start = path.stem[:40]  # whatever its letters take, room is left for the rest
    handle, name = tempfile.mkstemp(prefix=f".{start}.", suffix=path.suffix.lower(), dir=target.parent)
    temporary = Path(name)
    _unfinished.add(temporary)
    try:
        os.close(handle)
        yield temporary
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
        _unfinished.discard(temporary)


def resolve_link(path: Path) -> Path:
    """The file that is written: what ``path`` leads to where it is a link, else itself. It need not be there yet.

    :raises OutputError: what is there is no ordinary file, which renaming would remove, or the links lead nowhere.
    """
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    link = f"it is a link to {target}, and that" if target != path else "it"
    try:
        mode = target.stat().st_mode
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OutputError(f"cannot write {path}: its links lead in a circle; choose another name") from error
        return target  # nothing is there, or why it cannot be written is told when it is
    if not stat.S_ISREG(mode):
        what = "a folder" if stat.S_ISDIR(mode) else "a device, a pipe or a socket"
        raise OutputError(f"cannot write {path}: {link} is {what}, not an ordinary file; choose another name")
    return target


def reason(error: OSError) -> str:
    """Why a file could not be written, and what to do."""
    if error.errno == errno.ENAMETOOLONG:
        return f"{error.strerror}; choose a shorter name"
    if error.errno == errno.ENOENT:
        return "its folder does not exist; create it or choose another"
    return f"{error.strerror or error}; free some space or choose another folder"


def remove_temporary_files() -> None:
    """Remove what is being written; for a process that is about to leave without any of its exits."""
    for temporary in list(_unfinished):
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
