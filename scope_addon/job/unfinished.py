# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of captures in progress: what has been observed, with which the same capture continues
after a kill.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import NoPersonError
from ..temporary import own_entries, remove, remove_if_empty
from .request import code_version

FOLDER = "unfinished"
_FOLDER_NAME = re.compile("[0-9a-f]{32}")
ROOT = Path(__file__).resolve().parents[2]
_ABANDONED_S = 7 * 24 * 3600.0
_LARGEST = 2 << 30  # bytes of all captures
_RUNNING_S = 600.0  # within which a running capture has written


@contextmanager
def unfinished_capture(root: Path | None, footage: Path) -> Iterator[Path | None]:
    """Give the folder of a capture, and remove it when the capture is finished, or has found
    nobody.

    The folder is made by whoever first writes to it. It stays if the block is left by another
    exception.

    :param root: folder of caches; None: nothing is to be kept.
    """
    if root is None:
        yield None
        return
    _remove_old(root)
    folder = root / FOLDER / _name(footage)
    try:
        yield folder
    except NoPersonError:
        _remove(folder)
        raise
    _remove(folder)


def _name(footage: Path) -> str:
    """Return a name for a capture of this footage with this program."""
    described = [os.path.realpath(footage), code_version(ROOT)]
    with suppress(OSError):
        status = footage.stat()
        described += [str(status.st_size), str(status.st_mtime_ns)]
    return hashlib.sha256(json.dumps(described).encode()).hexdigest()[:32]


def unfinished_captures(root: Path) -> list[Path]:
    """Return the folders of captures in a folder of caches."""
    return own_entries(root / FOLDER, _FOLDER_NAME)


def _remove(folder: Path) -> None:
    remove(folder)
    remove_if_empty(folder.parent)


def _remove_old(root: Path) -> None:
    """Remove what is old, and if all is too much, the oldest."""
    found = []
    for folder in unfinished_captures(root):
        with suppress(OSError):
            size, changed_s = _size_and_time(folder)
            found.append((time.time() - changed_s, size, folder))
    total = 0
    for age_s, size, folder in sorted(found):
        total += size
        if age_s > _ABANDONED_S or (total > _LARGEST and age_s > _RUNNING_S):
            remove(folder)


def _size_and_time(folder: Path) -> tuple[int, float]:
    """Return the bytes of a folder's files, and when a file was last written into it or its
    folders.

    :raises OSError: it is being removed.
    """
    below = [folder, *folder.rglob("*")]
    size = sum(path.stat().st_size for path in below if path.is_file())
    return size, max(path.stat().st_mtime for path in below if path.is_dir())
