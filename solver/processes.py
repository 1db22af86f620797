# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose a temporary file is: its name tells the computer and the process, so that others remove what a kill left."""

from __future__ import annotations

import os
import platform
import time
import zlib
from pathlib import Path

_ABANDONED_S = 24 * 3600.0  # age from which a temporary file is removed if its process cannot be asked about


def owner() -> str:
    """Return the part of a temporary file's name that tells the computer and this process."""
    return f"{computer()}-{os.getpid()}"


def is_abandoned(path: Path, owned_by: str) -> bool:
    """Return whether the process that made a temporary file or folder does not run any more.

    :param owned_by: the part of its name that `owner` gave, which may be followed by ``-`` and more.
    :raises OSError: it does not exist any more.
    """
    where, _, rest = owned_by.partition("-")
    process = rest.partition("-")[0]
    if len(where) != len(computer()) or not process.isdecimal():
        return False  # somebody else's name
    old = time.time() - path.stat().st_mtime > _ABANDONED_S
    return old or (where == computer() and not runs(int(process)))


def computer() -> str:
    """Return a short name of this computer: folders may be shared with others."""
    return f"{zlib.crc32(platform.node().encode('utf-8', 'replace')):08x}"


def runs(process: int) -> bool:
    """Return whether a process of this computer runs, or cannot be asked about."""
    if os.name == "nt":  # where the signal 0 would end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        pass
    return True
