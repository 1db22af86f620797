# SPDX-License-Identifier: GPL-3.0-or-later
"""Footage that must stay the same while it is read, from the first picture of a capture to the last
one of its overlay; and files that its options name.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...solver.errors import ScopeError
from ..content import add_content, size_and_time, state_of
from ..errors import ChangedFootageError, unreadable

_INTERVAL_S = 2.0  # between two looks at the files
# Of which the content is read; more of a video, or of all pictures together, is sampled.
_MOST_BYTES = 1 << 30
_LEAST_BYTES = 1 << 16  # of each picture


class WatchedFiles:
    """Files that options name, as they were at the beginning: some are read more than once, such as
    a camera's path for its lens and for its poses.
    """

    def __init__(self, files: Iterable[Path]) -> None:
        self._states = {file: (size_and_time(file), _whole_content(file)) for file in files}

    def check(self) -> None:
        """Compare the files with what they were; one that was written again with the same content
        is the same.

        :raises ChangedFootageError: one was replaced, changed or removed.
        """
        for file, (before, content) in self._states.items():
            if size_and_time(file) != before and _whole_content(file) != content:
                raise _changed(file)


class WatchedFootage:
    """The files of a video or a sequence, as they were at the beginning.

    :param rate_given: whether the user has given a frame rate, so that a picture begins a sequence.
    """

    def __init__(self, path: Path, rate_given: bool = False) -> None:
        self._path = path
        self._rate_given = rate_given
        self._states: dict[Path, tuple[int, ...]] = {}
        with suppress(OSError):  # which the capture says
            self._states = {file: state_of(file) for file in self._files()}
        self._contents: dict[Path, bytes] = {}  # once they are asked for
        self._grows = self._ends()
        self._looked_s = time.monotonic()

    def content(self) -> str:
        """Return a hash of the names and contents of the files.

        :raises OSError: one cannot be read.
        """
        digest = hashlib.sha256()
        for file in self._states:
            self._contents[file] = self._content_of(file)
            digest.update(repr(file.name).encode())
            digest.update(self._contents[file])
        return digest.hexdigest()

    def check(self) -> None:
        """Compare the files with what they were. A video to which was only added is the same: what
        is read of it is what was there.

        :raises ChangedFootageError: a file was replaced, changed, added or removed.
        :raises VideoError: that cannot be seen, as where a server is gone.
        """
        self._looked_s = time.monotonic()
        try:
            files = self._files()
            changed = [file for file in files if not self._is_as_it_was(file)]
            has_grown = self._has_grown()
        except OSError as error:
            raise unreadable(self._path, error) from error
        if has_grown:
            return
        if changed or len(files) != len(self._states):
            raise _changed(changed[0] if changed else self._path)

    def _content_of(self, file: Path) -> bytes:
        digest = hashlib.sha256()
        add_content(digest, file, max(_LEAST_BYTES, _MOST_BYTES // max(1, len(self._states))))
        return digest.digest()

    def _is_as_it_was(self, file: Path) -> bool:
        """Return whether a file's state is that of the beginning, or differs in the number alone
        that the file system gives it, and the content is the same: some file systems of networks
        and of user space give a file another number after a while.

        :raises OSError: that cannot be seen.
        """
        before = self._states.get(file, ())
        now = state_of(file)
        if now == before:
            return True
        if now[2:] != before[2:] or file not in self._contents:
            return False
        is_same = self._content_of(file) == self._contents[file]
        if is_same:
            self._states[file] = now
        return is_same

    def watched(self, progress: Callable[..., None], to_end: bool = False) -> Callable[..., None]:
        """Return a function that reports progress, and looks at the files from time to time.

        :param to_end: also when the number of what is done reaches that of all.
        """

        def report(*values: Any) -> None:
            is_last = to_end and values[-2] >= values[-1]
            if is_last or time.monotonic() - self._looked_s > _INTERVAL_S:
                self.check()
            progress(*values)

        return report

    def _files(self) -> list[Path]:
        # Imported here, so that a missing package is reported in the panel.
        from ..capture.media.image_sequence import find_sequence

        try:
            sequence = find_sequence(self._path, self._rate_given)
        except ScopeError:
            return []  # which the capture says
        if sequence is not None:
            return list(sequence.paths)
        return [self._path] if self._path.is_file() else []

    def _ends(self) -> bytes:
        """Return a hash of the first and last bytes of a video as it was."""
        if len(self._states) != 1:
            return b""
        digest = hashlib.sha256()
        ((file, state),) = self._states.items()
        try:
            with file.open("rb") as stream:
                size = min(_LEAST_BYTES, state[2])
                digest.update(stream.read(size))
                stream.seek(state[2] - size)
                digest.update(stream.read(size))
        except (OSError, IndexError):
            return b""
        return digest.digest()

    def _has_grown(self) -> bool:
        """Return whether a video is longer than it was, and the same up to its former end."""
        if len(self._states) != 1:
            return False
        ((file, before),) = self._states.items()
        now = state_of(file)
        is_longer = len(before) == len(now) and now[:2] == before[:2] and now[2:3] > before[2:3]
        return is_longer and self._grows != b"" and self._ends() == self._grows


def _whole_content(file: Path) -> bytes:
    """Return a hash of a file; empty if it cannot be read, which whoever reads it says."""
    digest = hashlib.sha256()
    try:
        add_content(digest, file, _MOST_BYTES)
    except OSError:
        return b""
    return digest.digest()


def _changed(file: Path) -> ChangedFootageError:
    return ChangedFootageError(
        f"{file} was changed while it was read, so the results would mix both; capture again"
    )
