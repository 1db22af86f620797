# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of attempts below the output folder, and publishing: only checked results get their final
names.

The folder is a temporary one, and is removed by another batch if this one is killed. An attempt
that was given up has no folder any more. A worker that was thought lost and still runs can
therefore not publish anything, because only this machine renames results.
"""

from __future__ import annotations

import errno
import secrets
import shutil
from pathlib import Path
from typing import Any

from ..atomic_write import atomic_path, reason, replace_durably, resolve_link
from ..errors import OutputError
from ..job.clips.finished import file_hash
from ..temporary import claim, discard, remove

TOKEN = "token"  # file by which a worker shows that it sees the same folder


class Staging:
    """The folders of one batch.

    :param out: output folder.
    :raises OutputError: the folder cannot be created.
    """

    def __init__(self, out: Path) -> None:
        self._out = out
        self.token = secrets.token_hex(16)
        try:
            out.mkdir(parents=True, exist_ok=True)
            self.folder = claim(out, ".attempts-")
            self.folder.mkdir()  # for whoever the workers run as
            (self.folder / TOKEN).write_text(self.token)
        except OSError as error:
            raise OutputError(f"cannot write to {out}: {reason(error)}") from error

    def attempt(self, number: int) -> str:
        """Return the path of an attempt's folder, which the worker makes."""
        return str(self.folder / str(number))

    def windows(self, number: int) -> Path | None:
        """Return the path of a folder for the windows of a clip; None where clips are not
        divided.
        """
        return self.folder / f"windows{number}"

    def publish(
        self, attempt: str, outputs: list[str], content: dict[str, Any], folder: Path | None = None
    ) -> bool:
        """Give the results of an attempt their final names, and return True; False if one is not
        what was captured.

        :param folder: to which they go, if not to the output folder.
        :param outputs: the results, relative to the attempt's folder and to that one.
        :param content: their ``sha256`` and ``bytes``, as the worker has computed them.
        :raises OSError: a result cannot be renamed.
        :raises OutputError: a final name is that of a folder or device.
        """
        try:
            if not all(
                file_hash(Path(attempt, name)) == content[name]["sha256"] for name in outputs
            ):
                return False
        except (OSError, KeyError):
            return False
        for name in outputs:
            _rename(Path(attempt, name), (folder or self._out) / name)
        return True

    def write_report(self, file: Path) -> None:
        """Do nothing: the report is written to the output folder itself."""

    def remove(self, attempt: str) -> None:
        """Remove the folder of an attempt, after which its results cannot be published."""
        remove(Path(attempt))

    def close(self) -> None:
        """Remove the folders of all attempts."""
        discard(self.folder)


def _rename(staged: Path, final: Path) -> None:
    final.parent.mkdir(parents=True, exist_ok=True)
    try:
        # The worker, which wrote the file, has synced its content.
        replace_durably(staged, resolve_link(final))
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        with atomic_path(final) as temporary:  # a folder of the results is a link to another disk
            shutil.copyfile(staged, temporary)
