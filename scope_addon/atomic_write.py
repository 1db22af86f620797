# SPDX-License-Identifier: GPL-3.0-or-later
"""Atomic writes: a file is written under a temporary name and renamed, so that it is complete or
absent. What a killed process leaves, the next one that writes there removes.
"""

from __future__ import annotations

import contextlib
import errno
import io
import itertools
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from .errors import OutputError
from .temporary import claim, discard, sync_folder

if TYPE_CHECKING:
    from numpy.typing import NDArray

_PIECE = 1 << 23  # bytes of an archive that are written at once, at least
# What says that a file system never syncs or has no permissions, as some of networks, cameras'
# cards and user space: no reason to write nothing. Windows lacks some of these numbers.
_UNSUPPORTED = (errno.EINVAL, errno.ENOSYS, errno.EPERM, errno.EOPNOTSUPP)


@contextmanager
def atomic_path(path: Path, durable: bool = True) -> Iterator[Path]:
    """Create a temporary file in the folder of ``path``, and rename it to ``path`` when the block
    ends.

    If the block is left by an exception, the temporary file is removed and ``path`` is unchanged.
    A power cut within the block leaves the earlier file; after it, the new one is on the disk. If
    ``path`` is a link, its target is written and the link stays.

    :param durable: False: do not wait for the disk, for a file that nobody needs after a power cut.
    :return: context manager that gives the temporary file's path. The block may replace the file,
        which is empty at first, but has to leave a file of that name.
    :raises OSError: the file cannot be created or renamed.
    :raises OutputError: ``path`` exists and is not a regular file.
    """
    with complete_file(resolve_link(path), durable, suffix=path.suffix) as temporary:
        yield temporary


@contextmanager
def complete_file(
    target: Path, durable: bool = True, mode: int | None = None, suffix: str = ""
) -> Iterator[Path]:
    """Write a file as `atomic_path` does, but replace a link by it: for a name that nobody but this
    program gives, under which a link leads where nobody has asked to write.

    :param mode: permissions; None: those of any new file.
    :param suffix: of the temporary file, by which exporters know the format; empty: the target's.
    :raises OSError: the file cannot be created or renamed.
    """
    # Short enough for the limit on names, even where a letter takes several bytes, and without
    # bytes that are not UTF-8, at which exporters fail.
    stem = target.stem[:40].encode("utf-8", "ignore").decode()
    temporary = claim(target.parent, f".{stem}.", (suffix or target.suffix).lower())
    try:
        # The system decides on the permissions of a new file, by the process's umask or the
        # folder's list. To read the umask, one has to change it for a moment, in which other
        # threads' files would be writable for everybody.
        handle = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
        of_new_files = stat.S_IMODE(os.fstat(handle).st_mode)
        os.close(handle)
        yield temporary
        if durable:
            # The lock's name first: btrfs would write the content alone, which nobody would remove.
            sync_folder(target.parent)
            _sync(temporary)
        with _where_supported():
            # A library may have replaced the file by one of its own.
            os.chmod(temporary, of_new_files if mode is None else mode)
        if durable:
            replace_durably(temporary, target)
        else:
            os.replace(temporary, target)
    finally:
        discard(temporary)


def create_new(path: Path) -> Path:
    """Create an empty file that nothing else has had, and return its path: ``path``, or where that
    is taken ``NAME 2``, ``NAME 3``, ….

    For what grows under a name of its own, until it is complete, and is kept by a kill.

    :raises OSError: it cannot be created.
    """
    for number in itertools.count(1):
        other = path if number == 1 else path.with_stem(f"{path.stem} {number}")
        with contextlib.suppress(FileExistsError):
            os.close(os.open(other, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
            return other
    raise AssertionError("there are more numbers")


def finish(temporary: Path, target: Path) -> None:
    """Give a complete file its name, once its content is on the disk.

    :raises OSError: the disk refuses the content, or the file cannot be renamed.
    :raises OutputError: ``target`` exists and is not a regular file.
    """
    target = resolve_link(target)
    _sync(temporary)
    replace_durably(temporary, target)


def _sync(path: Path) -> None:
    """Wait until a file's content is on the disk; otherwise its name may get there before it.

    :raises OSError: the disk refuses the content, which some only say now.
    """
    # Windows syncs only what is open for writing.
    handle = os.open(path, os.O_RDWR | getattr(os, "O_BINARY", 0))
    try:
        sync_open_file(handle)
    finally:
        os.close(handle)


def sync_open_file(handle: int) -> None:
    """Wait until the content of an open file is on the disk, where the file system can.

    :raises OSError: the disk refuses the content.
    """
    with _where_supported():
        os.fsync(handle)


@contextmanager
def _where_supported() -> Iterator[None]:
    """Go on where a file system does not know what is asked of it."""
    try:
        yield
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            raise


def replace_durably(source: Path, target: Path) -> None:
    """Rename a file whose content is on the disk, and wait until its new name is there too.

    :raises OSError: the file cannot be renamed.
    """
    os.replace(source, target)
    sync_folder(target.parent)


def write_result(path: Path, content: str | bytes) -> None:
    """Write a file as `atomic_path` does, text as UTF-8.

    :raises OutputError: the file cannot be written.
    """
    try:
        with atomic_path(path) as temporary:
            if isinstance(content, str):
                temporary.write_text(content, encoding="utf-8")
            else:
                temporary.write_bytes(content)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {reason(error)}") from error


def write_npz(
    path: Path,
    arrays: Mapping[str, NDArray[Any]],
    compressed: bool = False,
    *,
    replaces_links: bool = False,
) -> None:
    """Write arrays as an ``.npz``, complete or not at all: the same bytes as numpy's ``savez``.

    They are packed in memory one by one, because a zip file that the disk refuses prints a
    traceback when it is destroyed, and a motion of an hour takes 160 MB.

    :param arrays: by their names, (...) each.
    :param compressed: as ``savez_compressed`` does.
    :param replaces_links: as `complete_file` does, for names that nobody but this program gives.
    :raises OSError: the file cannot be written.
    :raises OutputError: ``path`` exists and is not a regular file.
    """
    import zipfile

    import numpy as np

    packed = _MovedFile()
    method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    written = complete_file(path) if replaces_links else atomic_path(path)
    with written as temporary, temporary.open("wb") as file:
        with zipfile.ZipFile(packed, "w", method) as archive:
            for name, array in arrays.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                    write_array: Any = np.lib.format.write_array  # numpy declares no types
                    write_array(member, np.asanyarray(array), allow_pickle=False)
                if packed.size >= _PIECE:
                    packed.move_to(file)
        packed.move_to(file)


class _MovedFile(io.BytesIO):
    """A file in memory whose content is moved elsewhere from time to time; positions count from its
    first byte.
    """

    _moved = 0

    @property
    def size(self) -> int:
        """The number of bytes in memory."""
        return len(self.getbuffer())

    def move_to(self, file: BinaryIO) -> None:
        """Append the content to a file, after which it is not in memory any more."""
        with self.getbuffer() as content:
            file.write(content)
            self._moved += len(content)
        super().seek(0)
        self.truncate()

    def tell(self) -> int:
        """Return the position."""
        return self._moved + super().tell()

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a position that is in memory, and return it."""
        return self._moved + super().seek(
            offset - self._moved if whence == io.SEEK_SET else offset, whence
        )


def resolve_link(path: Path) -> Path:
    """Return the file that writing to ``path`` changes: the target of a link, otherwise ``path``.
    It may not exist yet.

    :raises OutputError: the file exists and is not a regular one, which renaming would replace; or
        links form a loop.
    """
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    link = f"it is a link to {target}, and that" if target != path else "it"
    try:
        mode = target.stat().st_mode
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OutputError(
                f"cannot write {path}: its symbolic links form a loop; choose another name"
            ) from error
        return target  # it does not exist; any other problem is reported when it is written
    if not stat.S_ISREG(mode):
        what = "a folder" if stat.S_ISDIR(mode) else "a device, a pipe or a socket"
        raise OutputError(
            f"cannot write {path}: {link} is {what}, not a regular file; choose another name"
        )
    return target


def reason(error: OSError) -> str:
    """Describe why a file could not be written, and what to do."""
    if error.errno == errno.ENAMETOOLONG:
        return f"{error.strerror}; choose a shorter name"
    if error.errno == errno.ENOENT and not _is_in_folder(error.filename):
        return "its folder does not exist; create it or choose another"
    if error.errno in (errno.ENOENT, errno.EINVAL, errno.EILSEQ):
        return (
            f"{error.strerror}; if the disk has no such names, choose one without signs such as "
            ": ? * and without a dot at its end, or choose another folder"
        )
    return f"{error.strerror or error}; free some space or choose another folder"


def _is_in_folder(path: object) -> bool:
    """Return whether the folder of a path, as an error has it, exists."""
    return isinstance(path, str) and os.path.isdir(os.path.dirname(path) or os.curdir)
