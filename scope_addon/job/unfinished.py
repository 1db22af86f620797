# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of captures in progress: what has been observed, with which the same capture continues
after a kill.

A capture that runs holds a lock beside its folder. So a second one of the same footage keeps
nothing, and neither of them removes what the other one needs.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from ..errors import ChangedFootageError, NoPersonError
from ..notices import Notice, notice
from ..temporary import hold, is_abandoned, is_held, own_entries, release, remove, remove_if_empty
from .request import code_version
from .watched_footage import WatchedFootage

FOLDER = "unfinished"
_HASH = 32  # letters of a hash in a name
_FOLDER_NAME = re.compile("[0-9a-f]{32}-[0-9a-f]{32}")
_ABANDONED_S = 7 * 24 * 3600.0
_LARGEST = 2 << 30  # bytes of all captures


class UnfinishedCapture(NamedTuple):
    """A capture in progress.

    :param folder: with what an earlier one had found, if it was stopped; None: nothing is kept.
    :param footage: as it was when the capture began.
    :param warnings: what is to be said of earlier captures.
    """

    folder: Path | None
    footage: WatchedFootage
    warnings: list[Notice]


@contextmanager
def unfinished_capture(
    root: Path | None, path: Path, rate_given: bool = False
) -> Iterator[UnfinishedCapture]:
    """Give the folder of a capture, and remove it when the capture is finished, or has found
    nobody.

    It is that of this program and of the footage's content, so that nothing is continued with other
    images than those with which it began; what is left of others is removed. The folder is made by
    whoever first writes to it. It stays if the block is left by another exception. There is none
    where the same capture runs already.

    :param root: folder of caches; None: nothing is to be kept.
    :param path: of the footage.
    :param rate_given: see `WatchedFootage`.
    """
    footage = WatchedFootage(path, rate_given)
    folder = None if root is None else _folder(root, path, footage)
    if root is None or folder is None or not _lock(folder):
        yield UnfinishedCapture(None, footage, [])
        return
    try:
        _remove_old(folder)
        former = _folders_of_other_content(folder)
        for each in former:
            remove(each)
        warnings = [notice("changed_footage", footage=path.name)] if former else []
        try:
            yield UnfinishedCapture(folder, footage, warnings)
        except (NoPersonError, ChangedFootageError):
            remove(folder)
            raise
        remove(folder)
    finally:
        release(_lock_of(folder))
        remove_if_empty(folder.parent)


def _lock_of(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.lock")


def _lock(folder: Path) -> bool:
    """Lock the folder of a capture; return False if the same capture runs already, or if nothing
    can be written there.
    """
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        return hold(_lock_of(folder))
    except OSError:
        return False


def _is_running(folder: Path) -> bool:
    return is_held(_lock_of(folder))


def _folder(root: Path, path: Path, footage: WatchedFootage) -> Path | None:
    """Return the folder of a capture of this footage with this program; None if the footage cannot
    be read.
    """
    where = json.dumps([os.path.realpath(path), code_version()])
    try:
        content = footage.content()
    except OSError:
        return None
    name = hashlib.sha256(where.encode()).hexdigest()[:_HASH]
    return root / FOLDER / f"{name}-{content[:_HASH]}"


def _folders_of_other_content(folder: Path) -> list[Path]:
    """Return what is left of captures of the same name, whose footage was another one."""
    begin = folder.name[: _HASH + 1]
    return [
        each
        for each in own_entries(folder.parent, _FOLDER_NAME)
        if each.name.startswith(begin) and each.name != folder.name and not _is_running(each)
    ]


def unfinished_captures(root: Path) -> list[Path]:
    """Return the folders in a folder of caches of captures that do not run."""
    return [
        folder for folder in own_entries(root / FOLDER, _FOLDER_NAME) if not _is_running(folder)
    ]


def _remove_old(own: Path) -> None:
    """Remove what is old beside the folder of a capture, and if all is too much, the oldest; and
    the locks of captures that were killed when they had no folder.
    """
    for lock in own.parent.glob("*.lock"):
        is_ours = _FOLDER_NAME.fullmatch(lock.stem) is not None
        if is_ours and not lock.with_suffix("").exists() and is_abandoned(lock):
            remove(lock)
    found = []
    with suppress(OSError):  # its time stays that at which it was made
        os.utime(_lock_of(own))
    for folder in own_entries(own.parent, _FOLDER_NAME):
        with suppress(OSError):
            # A server's clock may be another one than ours.
            now_s = _lock_of(own).stat().st_mtime
            size, changed_s = _size_and_time(folder)
            found.append((now_s - changed_s, size, folder))
    total = 0
    for age_s, size, folder in sorted(found):
        total += size
        if (age_s > _ABANDONED_S or total > _LARGEST) and not _is_running(folder):
            remove(folder)
            release(_lock_of(folder))


def _size_and_time(folder: Path) -> tuple[int, float]:
    """Return the bytes of a folder's files, and when a file was last written into it or its
    folders.

    :raises OSError: it is being removed.
    """
    below = [folder, *folder.rglob("*")]
    size = sum(path.stat().st_size for path in below if path.is_file())
    return size, max(path.stat().st_mtime for path in below if path.is_dir())
