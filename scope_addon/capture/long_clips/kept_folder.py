# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder in which a capture keeps what it has found, so that it can go on after it was killed."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from ....solver.errors import ScopeError

LARGEST = 1 << 30  # bytes of one capture's files of a kind; some five hours of estimates


class KeptFolder:
    """What cannot be written is not kept: nothing depends on it but time.

    :param folder: need not exist.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder
        self.is_open = True
        self._bytes = 0

    def write(self, write_file: Callable[[Path], Path]) -> None:
        """Write a file; after a failure, or when there is too much, nothing any more.

        :param write_file: takes the folder, and returns the file that it has written there.
        """
        if not self.is_open:
            return
        try:
            self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
            self.count(write_file(self.path))
        except (OSError, ScopeError):
            self.is_open = False

    def count(self, file: Path) -> None:
        """Count a file that may be there as kept."""
        with suppress(OSError):
            self._bytes += file.stat().st_size
        self.is_open &= self._bytes <= LARGEST
