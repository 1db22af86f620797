# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of temporary files that tell whose they are, so that other processes can remove what a
killed one has left.

Such a name contains ``owner()``: the computer and the process, ``1a2b3c4d-1234``.
"""

from __future__ import annotations

import os
import platform
import time
import zlib
from pathlib import Path

# age from which a temporary file is removed if its process cannot be asked about
_ABANDONED_S = 24 * 3600.0


def owner() -> str:
    """Return the part of a temporary file's name that identifies the computer and this process."""
    return f"{computer()}-{os.getpid()}"


def has_ended(owned_by: str) -> bool:
    """Return whether a temporary file's process was one of this computer, and does not run any
    more.

    :param owned_by: the part of its name that `owner` gave, which may be followed by ``-`` and
        more; of any other name, the answer is no.
    """
    where, process = _parts(owned_by)
    return where == computer() and process.isdecimal() and not _runs(int(process))


def is_abandoned(path: Path, owned_by: str) -> bool:
    """Return whether a temporary file or folder belongs to no running process: it has ended, or the
    file is a day old.

    :param owned_by: see `has_ended`.
    :raises OSError: the file does not exist any more.
    """
    where, process = _parts(owned_by)
    if len(where) != len(computer()) or not process.isdecimal():
        return False  # somebody else's name
    return time.time() - path.stat().st_mtime > _ABANDONED_S or has_ended(owned_by)


def computer() -> str:
    """Return a short name of this computer: folders may be shared with others."""
    return f"{zlib.crc32(platform.node().encode('utf-8', 'replace')):08x}"


def _parts(owned_by: str) -> tuple[str, str]:
    """Return the computer and the process, as far as the name has them."""
    where, _, rest = owned_by.partition("-")
    return where, rest.partition("-")[0]


def _runs(process: int) -> bool:
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
