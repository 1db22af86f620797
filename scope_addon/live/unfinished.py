# SPDX-License-Identifier: GPL-3.0-or-later
"""The names of what a live capture writes while it runs, and whether its process has ended.

Beside a growing recording lies a lock of its process, so that what a kill has left is known. It is
removed when it is finished, or when the user cancels, and never by itself. Blender's panel draws by
this, so that it needs the standard library alone.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from ..content import newest_first, size_and_time
from ..errors import OutputError
from ..private_folder import lasting_folder
from ..temporary import is_abandoned, remove, system_folder

SUFFIX = ".recording"
RECORDINGS = "recordings"  # the folder for them, in a cache


def lock_of(recording: Path) -> Path:
    """Return the lock that the process of a recording holds."""
    return recording.with_name(f".{recording.name}.lock")


def is_recording(source: str) -> bool:
    """Return whether a source is the file of a recording that was not finished."""
    return source.endswith(SUFFIX) and os.path.isfile(source)


def is_unfinished(recording: Path) -> bool:
    """Return whether the process of a recording has ended, and not finished it."""
    return recording.is_file() and is_abandoned(lock_of(recording))


def other_places(folder: Path) -> list[Path]:
    """Return folders for what cannot be written to one: of the user, and for temporary files."""
    lasting = lasting_folder()
    folders = [*([lasting / RECORDINGS] if lasting else []), temporary_place()]
    return [other for other in folders if other != folder]


def temporary_place() -> Path:
    """Return the user's folder for recordings in the system's temporary one, which may have very
    many files of others. It need not exist, or may be someone else's.
    """
    user = f"-{os.geteuid()}" if hasattr(os, "geteuid") else ""
    return system_folder() / f"scope-{RECORDINGS}{user}"


def recordings_in(folder: Path) -> list[Path]:
    """Return the recordings in a folder, the newest first."""
    with suppress(OSError):
        return newest_first(folder.glob(f"*{SUFFIX}"))
    return []


def remove_recording(recording: Path) -> None:
    """Remove the growing file of a recording that is finished or not wanted."""
    remove(recording)
    remove(lock_of(recording))


def unfinished_video(path: Path) -> Path:
    """Return the name of a recording's video while it grows."""
    return path.with_stem(f"{path.stem}.unfinished")


class Target:
    """A file that a live capture replaces at its end, but not if another one, which ran at the same
    time, has written it meanwhile.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._before = size_and_time(path)

    def check(self) -> None:
        """Compare the file with what it was.

        :raises OutputError: somebody has written it.
        """
        if size_and_time(self._path) != self._before:
            raise OutputError(
                f"{self._path} is not replaced, since another program has written it meanwhile"
            )
