# SPDX-License-Identifier: GPL-3.0-or-later
"""Which files an export may write. Free of bpy, so that the command line can check its arguments first."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from ...atomic_write import reason, resolve_link
from ...errors import OutputError, UsageError

SUFFIXES = (".glb", ".fbx", ".blend", ".bvh", ".usdc", ".npz")
PER_PERSON = (".bvh", ".npz")  # formats that hold one person a file


def check_output(path: str | Path, suffixes: tuple[str, ...] = SUFFIXES) -> Path:
    """The path, when a file of a known format can be written there.

    :raises UsageError: unknown suffix, or a folder.
    :raises OutputError: the folder is missing or cannot be written to, the name is too long, or what is there is no
        ordinary file.
    """
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        if path.is_dir():
            known = ", ".join(suffixes)
            raise UsageError(f"cannot write {path}: it is a folder; name a file in it, whose suffix is one of {known}")
        raise UsageError(f"cannot write '{path.name}': its suffix must be one of {', '.join(suffixes)}")
    folder = path.parent
    if not folder.is_dir():
        raise OutputError(f"cannot write {path}: the folder {folder} does not exist; create it or choose another")
    try:
        path.lstat()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise OutputError(f"cannot write {path}: {reason(error)}") from error
    if path.is_dir():
        raise OutputError(f"cannot write {path}: a folder of that name is there; choose another place")
    folder = resolve_link(path).parent
    if not folder.is_dir():
        raise OutputError(f"cannot write {path}: it is a link into {folder}, which does not exist; choose another name")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"cannot write {path}: the folder {folder} is not writable; choose another place")
    return path


def person_paths(path: str | Path, people: int, separate: bool = False) -> list[Path]:
    """One path per person for the formats that hold one: OUT.bvh, or OUT.person1.bvh, OUT.person2.bvh, …

    :param separate: for the others too.
    """
    path = Path(path)
    if people == 1 or not (separate or path.suffix.lower() in PER_PERSON):
        return [path]
    return [path.with_name(f"{path.stem}.person{i + 1}{path.suffix}") for i in range(people)]
