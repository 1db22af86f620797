# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder that nobody else can have prepared: what lies in it is unpickled and run."""

from __future__ import annotations

import os
import stat
import sys
from functools import cache
from pathlib import Path

from .temporary import new_folder

_NAME = "scope-mocap"


@cache
def private_folder() -> Path:
    """Return a folder of the user's own, with access for nobody else, that lasts from one session
    to the next.

    It is the system's folder for caches. If that belongs to someone else, or cannot be used, it is
    a new folder with a name that cannot be predicted, for this session.
    """
    if lasting := lasting_folder():
        return lasting
    return new_folder(_NAME)


def lasting_folder() -> Path | None:
    """Return the folder in the system's one for caches; None if that belongs to someone else, or
    cannot be used.
    """
    try:
        folder = _caches() / _NAME
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return folder if is_private(folder) else None
    except (OSError, RuntimeError):  # the latter where there is no home
        return None


def is_private(folder: Path) -> bool:
    """Return whether a folder, no link, is the user's own; take away what access others have to it.
    Some disks, such as cameras' cards, have no permissions, and leave it to them.

    :raises OSError: it does not exist, or access cannot be changed.
    """
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode):
        return False
    if not hasattr(os, "geteuid"):  # Windows keeps the user's folders from others by itself
        return True
    if status.st_uid != os.geteuid():
        return False
    if _is_open_to_others(status):
        folder.chmod(0o700)
        return not _is_open_to_others(folder.lstat())
    return True


def _is_open_to_others(status: os.stat_result) -> bool:
    return bool(stat.S_IMODE(status.st_mode) & 0o077)


def _caches() -> Path:
    """Return the system's folder for this user's caches.

    :raises RuntimeError: the user has no home.
    """
    if sys.platform == "win32" and "LOCALAPPDATA" in os.environ:
        return Path(os.environ["LOCALAPPDATA"])
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    chosen = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return chosen if chosen.is_absolute() else Path.home() / ".cache"
