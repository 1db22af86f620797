# SPDX-License-Identifier: GPL-3.0-or-later
"""Checking and naming the files of an export. Free of bpy, so that the command line can check its
arguments first.
"""

from __future__ import annotations

import errno
import glob
import os
import re
from collections.abc import Collection
from pathlib import Path

from .atomic_write import reason, resolve_link
from .errors import OutputError, UsageError
from .notices import Notice, notice

# Formats that are written from the motion, without Blender.
WITHOUT_SCENE = (".trc", ".c3d", ".vrma", ".mot", ".csv", ".npz")
SUFFIXES = (".glb", ".fbx", ".blend", ".bvh", ".usdc", *WITHOUT_SCENE)
PER_PERSON = (".bvh", *WITHOUT_SCENE)  # formats with one person per file


def check_output(path: str | Path, suffixes: tuple[str, ...] = SUFFIXES) -> Path:
    """Check that a file of a known format can be written to the path, and return it.

    :raises UsageError: when the suffix is unknown, or the path is a folder.
    :raises OutputError: when the folder is missing or not writable, the name is too long, or the
        path is a folder or a link into a missing folder.
    """
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        if path.is_dir():
            known = ", ".join(suffixes)
            raise UsageError(
                f"cannot write {path}: it is a folder; name a file in it with one of "
                f"the suffixes {known}"
            )
        raise UsageError(
            f"cannot write '{path.name}': its suffix must be one of {', '.join(suffixes)}"
        )
    folder = path.parent
    if not folder.is_dir():
        raise OutputError(
            f"cannot write {path}: the folder {folder} does not exist; create it or choose another"
        )
    try:
        path.lstat()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise OutputError(f"cannot write {path}: {reason(error)}") from error
    if path.is_dir():
        raise OutputError(f"cannot write {path}: a folder of that name exists; choose another name")
    folder = resolve_link(path).parent
    if not folder.is_dir():
        raise OutputError(
            f"cannot write {path}: it is a link into {folder}, which does not exist; "
            "choose another name"
        )
    if not os.access(folder, os.W_OK):
        raise OutputError(
            f"cannot write {path}: the folder {folder} is not writable; choose another folder"
        )
    return path


def person_paths(path: str | Path, people: int, separate: bool = False) -> list[Path]:
    """Return one path per person for formats with one person per file: OUT.bvh, or OUT.person1.bvh,
    OUT.person2.bvh, …

    :param separate: also for the other formats.
    """
    path = Path(path)
    if people == 1 or not (separate or path.suffix.lower() in PER_PERSON):
        return [path]
    return [path.with_name(f"{path.stem}.person{i + 1}{path.suffix}") for i in range(people)]


def files_of_people(path: Path) -> list[Path]:
    """Return the existing files of a result, of whatever number of people; see `person_paths`."""
    of_person = re.compile(re.escape(path.stem) + r"\.person[0-9]+" + re.escape(path.suffix))
    beside = path.parent.glob(f"{glob.escape(path.stem)}.person*{glob.escape(path.suffix)}")
    people = sorted(each for each in beside if of_person.fullmatch(each.name))
    return [path, *people] if path.exists() else people


def left_over(paths: Collection[Path], written: Collection[Path]) -> Notice | None:
    """Return which files lie beside results as if they were a part of them, though they are of a
    capture with more people, or fewer; None if there are none.

    :param paths: as the user has given them.
    :param written: the results.
    """
    others = [each for path in paths for each in files_of_people(path) if each not in written]
    return notice("left_over", files=[each.name for each in others]) if others else None
