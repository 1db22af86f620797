# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of attempts below the output folder, and publishing: only checked results get their final
names.

An attempt that was given up has no folder any more. A worker that was thought lost and still runs
can therefore not publish anything, because only this machine renames results.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import stat
import time
from pathlib import Path
from typing import Any

from ..atomic_write import atomic_path, reason, replace_durably, resolve_link
from ..errors import OutputError
from ..job.clips.finished import file_hash
from ..processes import has_ended, owner

ATTEMPTS = ".scope-attempts"
TOKEN = "token"  # file by which a worker shows that it sees the same folder
# Of a batch's folder: computer, process and the beginning of its token.
_OWN_NAME = re.compile("[0-9a-f]{8}-[0-9]+-[0-9a-f]{8}")
_ABANDONED_S = 7 * 24 * 3600.0  # of another computer's batch, which may take days for a clip


class Staging:
    """The folders of one batch.

    :param out: output folder.
    :raises OutputError: the folder cannot be created.
    """

    def __init__(self, out: Path) -> None:
        self._out = out
        self.token = secrets.token_hex(16)
        if (out / ATTEMPTS).is_symlink():
            raise OutputError(
                f"{out / ATTEMPTS} is a link to another folder; a batch makes and removes folders "
                "there: remove the link, or choose another output folder"
            )
        _remove_abandoned(out / ATTEMPTS)
        self.folder = out / ATTEMPTS / f"{owner()}-{self.token[:8]}"
        try:
            self.folder.mkdir(parents=True)
            (self.folder / TOKEN).write_text(self.token)
        except OSError as error:
            raise OutputError(f"cannot write {self.folder}: {reason(error)}") from error

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
        shutil.rmtree(attempt, ignore_errors=True)

    def close(self) -> None:
        """Remove the folders of all attempts."""
        shutil.rmtree(self.folder, ignore_errors=True)
        _remove_if_empty(self.folder.parent)


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


def _remove_abandoned(folder: Path) -> None:
    """Remove the folders of batches that do not run any more, and nothing that a batch has not
    made: a folder with another name, without a token, or behind a link is somebody else's.
    """
    try:
        found = list(folder.iterdir())
    except OSError:
        return
    for path in found:
        if not _OWN_NAME.fullmatch(path.name) or path.is_symlink() or not _is_own(path):
            continue
        try:
            old = time.time() - path.stat().st_mtime > _ABANDONED_S
        except OSError:
            continue
        if old or has_ended(path.name):
            shutil.rmtree(path, ignore_errors=True)
    _remove_if_empty(folder)


def _is_own(folder: Path) -> bool:
    """Return whether a folder has the file that every batch writes into its own first, or nothing
    yet.
    """
    try:
        if not os.listdir(folder):
            return True
        return stat.S_ISREG((folder / TOKEN).lstat().st_mode)
    except OSError:
        return False


def _remove_if_empty(folder: Path) -> None:
    try:
        folder.rmdir()
    except OSError:
        pass
