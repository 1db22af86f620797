# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the results of attempts are collected and published: a folder that all workers see, or a
store of files that is addressed by URLs (``s3://``, ``gs://``, ``sftp://``), by `fsspec`.

Only checked results get their final names, and only this machine renames them: a worker that was
thought lost and still runs cannot publish anything, because an attempt that was given up has no
folder any more. The folder of the attempts is a temporary one, and is removed by another batch if
this one is killed.

A store moves a file to its final name by copying (S3, Google Cloud) or renaming (SFTP); either way
a reader finds the earlier file or the complete new one.
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import Any

import fsspec

from ...solver.errors import InputError, ScopeError
from ..atomic_write import atomic_path, reason, replace_durably, resolve_link
from ..errors import OutputError, UsageError
from ..footage import PICTURE_SUFFIXES, display_address, is_url, sequence_pattern
from ..job.batch import REPORT_NAME
from ..job.finished_clip import file_hash
from ..private_folder import lasting_folder
from ..temporary import claim, discard, hold, is_abandoned, release, remove

ATTEMPTS = ".scope-attempts"  # folder of all batches in a store of results
TOKEN = "token"  # file by which a worker shows that it sees the same folder


@contextmanager
def store_errors(error: type[InputError] | type[OutputError], url: str) -> Iterator[None]:
    """Raise whatever a store raises, whose classes differ from store to store, as ``error``.

    :raises InputError: or OutputError, as given.
    """
    try:
        yield
    except ScopeError:
        raise
    except Exception as failure:
        cause = " ".join(f"{failure}".split())[:200]
        # A store may quote a part of the address in which nobody would recognize a password.
        if not cause or display_address(url) != url:
            cause = type(failure).__name__
        raise error(
            f"{display_address(url)} cannot be used ({cause}); check the address and the "
            "credentials"
        ) from failure


def _open(url: str) -> tuple[Any, str]:
    """Return the file system of a URL and the path in it.

    :raises UsageError: there is no such kind of URL, or its package is missing.
    """
    try:
        file_system, path = fsspec.core.url_to_fs(url)
    except (ImportError, ValueError) as error:
        raise UsageError(f"{display_address(url)} cannot be used: {error}") from error
    return file_system, path.rstrip("/")


def names_below(url: str, without: str = "") -> list[str]:
    """Return the names of all files below a URL, relative to it; names that would lead elsewhere
    are left out.

    :param without: URL of a folder to leave out.
    :raises UsageError: the URL cannot be used.
    """
    file_system, root = _open(url)
    left_out = _open(without)[1] + "/" if without else ""
    file_system.invalidate_cache()
    paths = (str(path) for path in file_system.find(root))
    kept = [path for path in paths if not (left_out and path.startswith(left_out))]
    return list(_by_name(kept, root))


def _by_name(paths: Iterable[str], root: str) -> dict[str, str]:
    """Return paths by their names relative to a folder, without those that would lead elsewhere."""
    by_name = {path.removeprefix(root).lstrip("/"): path for path in paths}
    return {
        name: path
        for name, path in by_name.items()
        if name and "\\" not in name and not {"..", ATTEMPTS} & set(PurePosixPath(name).parts)
    }


def mirror_footage(url: str, out: str, folder: Path) -> Path:
    """Make a folder with an empty file for each one below a URL, so that clips can be chosen by
    their names.

    :param out: URL or path of the results, which are no footage.
    :raises InputError: the store cannot be read.
    :raises UsageError: the URL cannot be used.
    """
    with store_errors(InputError, url):
        _touch(folder, names_below(url, out if is_url(out) else ""))
    return folder


def mirror_results(url: str, folder: Path) -> Path:
    """Make a folder with a file of zeros of the same size for each result below a URL, and with the
    report of the previous batch.

    :raises OutputError: the store cannot be read.
    :raises UsageError: the URL cannot be used.
    """
    with store_errors(OutputError, url):
        file_system, root = _open(url)
        file_system.invalidate_cache()
        found = file_system.find(root, detail=True)
        names = _by_name(found, root)
        _touch(folder, list(names))
        for name, path in names.items():
            # Of a file with a hole, nothing is written to the disk.
            os.truncate(folder / name, found[path]["size"] or 0)
        if REPORT_NAME in names:
            file_system.get_file(f"{root}/{REPORT_NAME}", str(folder / REPORT_NAME))
    return folder


def _touch(folder: Path, names: list[str]) -> None:
    folder.mkdir(parents=True)
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


def download(url: str, folder: Path, *, with_sequence: bool = False) -> Path:
    """Download a file, or a folder of images, into a folder, and return its path.

    :param with_sequence: download the further images of a numbered image's sequence, too.
    :raises UsageError: the URL cannot be used.
    """
    file_system, path = _open(url)
    target = folder / PurePosixPath(path).name
    if file_system.isdir(path):
        target.mkdir()
        for each in file_system.find(path, maxdepth=1):
            file_system.get_file(each, str(target / PurePosixPath(each).name))
    elif with_sequence and target.suffix.lower() in PICTURE_SUFFIXES:
        for each in file_system.find(path.rpartition("/")[0], maxdepth=1):
            beside = folder / PurePosixPath(each).name
            if sequence_pattern(beside) == sequence_pattern(target):
                file_system.get_file(each, str(beside))
    else:
        file_system.get_file(path, str(target))
    return target


def upload(file: Path, url: str) -> None:
    """Upload a file, and check its size there.

    :raises OSError: it has another size.
    :raises UsageError: the URL cannot be used.
    """
    file_system, path = _open(url)
    file_system.makedirs(path.rpartition("/")[0], exist_ok=True)
    file_system.put_file(str(file), path)
    file_system.invalidate_cache()
    if file_system.size(path) != file.stat().st_size:
        raise OSError(f"{display_address(url)} is not as large as what was written")


def read_text(url: str) -> str:
    """Return the text of a file; empty if it does not exist.

    :raises UsageError: the URL cannot be used.
    """
    file_system, path = _open(url)
    return str(file_system.cat_file(path).decode()) if file_system.exists(path) else ""


def is_folder(url: str) -> bool:
    """Return whether there are files below a URL.

    :raises UsageError: the URL cannot be used.
    """
    file_system, path = _open(url)
    return bool(file_system.isdir(path))


class RemoteStaging:
    """The attempts of a batch below a URL; see `Staging`.

    :raises OutputError: the store cannot be written.
    :raises UsageError: the URL cannot be used.
    """

    def __init__(self, out: str) -> None:
        self._out = out.rstrip("/")
        self.token = secrets.token_hex(16)
        self.folder = f"{self._out}/{ATTEMPTS}/{self.token}"
        # A store has no locks. A batch is known to be abandoned on the machine that ran it.
        lasting = lasting_folder()
        self._locks = None if lasting is None else lasting / "batches"
        if self._locks is not None:
            with suppress(OSError):
                self._locks.mkdir(exist_ok=True)
                hold(self._locks / self.token)
        with store_errors(OutputError, out):
            self._remove_abandoned()
            file_system, path = _open(f"{self.folder}/{TOKEN}")
            file_system.makedirs(path.rpartition("/")[0], exist_ok=True)
            file_system.pipe_file(path, self.token.encode())

    def attempt(self, number: int) -> str:
        """Return the URL of an attempt's folder."""
        return f"{self.folder}/{number}"

    def publish(self, attempt: str, outputs: list[str], content: dict[str, Any]) -> bool:
        """Give the results of an attempt their final names; see `Staging.publish`. Their sizes are
        compared.

        :raises OutputError: the store cannot be written.
        :raises UsageError: the URL cannot be used.
        """
        with store_errors(OutputError, self._out):
            file_system, root = _open(attempt)
            file_system.invalidate_cache()
            for name in outputs:
                staged = f"{root}/{name}"
                if (
                    not file_system.exists(staged)
                    or file_system.size(staged) != content[name]["bytes"]
                ):
                    return False
            for name in outputs:
                self._move(f"{root}/{name}", name)
        return True

    def write_report(self, file: Path) -> None:
        """Upload the batch's report.

        :raises OutputError: the store cannot be written.
        :raises OSError: what was uploaded has another size.
        :raises UsageError: the URL cannot be used.
        """
        with store_errors(OutputError, self._out):
            staged = f"{self.folder}/{REPORT_NAME}"
            upload(file, staged)
            self._move(_open(staged)[1], REPORT_NAME)

    def _move(self, staged: str, name: str) -> None:
        file_system, final = _open(f"{self._out}/{name}")
        file_system.makedirs(final.rpartition("/")[0], exist_ok=True)
        file_system.mv(staged, final)

    def remove(self, attempt: str) -> None:
        """Remove what an attempt has uploaded."""
        _remove(attempt)

    def close(self) -> None:
        """Remove the folders of all attempts."""
        _remove(self.folder)
        with suppress(Exception):  # it is not empty, or the store has no folders
            file_system, path = _open(f"{self._out}/{ATTEMPTS}")
            file_system.rmdir(path)
        if self._locks is not None:
            release(self._locks / self.token)

    def _remove_abandoned(self) -> None:
        """Remove the attempts of batches of this machine that do not run any more."""
        if self._locks is None:
            return
        file_system, root = _open(f"{self._out}/{ATTEMPTS}")
        for path in file_system.ls(root, detail=False) if file_system.isdir(root) else []:
            lock = self._locks / PurePosixPath(path).name
            if is_abandoned(lock):
                file_system.rm(path, recursive=True)
                release(lock)


def _remove(url: str) -> None:
    """Remove a folder; what cannot be removed is left, and removed by a later batch."""
    with suppress(Exception):
        file_system, path = _open(url)
        file_system.invalidate_cache()
        if file_system.exists(path):
            file_system.rm(path, recursive=True)


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

    def windows(self, number: int) -> Path:
        """Return the path of a folder for the windows of a clip."""
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
