# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that may come from anyone: what is checked before they are read, and the arrays of .npz
files.

Reading a pipe may wait forever, reading a device may never end. Nothing is unpickled, and the size
of what is read is bounded: official SMPL-X files also carry pickled tables, which are not needed.
"""

from __future__ import annotations

import io
import stat
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ...solver.errors import InputError, ModelFileError

_LONGEST = 200  # characters
_ARCHIVE = b"PK"  # with which zip archives begin


def in_one_line(cause: object) -> str:
    """Return what another library said, or a file has, for a message: one line of moderate
    length.
    """
    return " ".join(str(cause).split())[:_LONGEST]


def check_regular(path: Path, error: type[InputError], what: str, largest_bytes: int) -> None:
    """Refuse a path that is a pipe or a device, or a file that is too large. What does not exist is
    not refused.

    :param error: class of what is raised.
    :param what: what the file should be, for the message, e.g. ``motion file``.
    :param largest_bytes: size up to which a file is accepted.
    :raises InputError: as `error`, when the path is a pipe or a device, or the file is too large.
    """
    try:
        status = path.stat()
    except OSError:
        return
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        raise error(f"{path} is a pipe or a device, not a regular file; choose a {what}")
    if stat.S_ISREG(status.st_mode) and status.st_size > largest_bytes:
        raise error(
            f"{path} has {status.st_size >> 20} MiB, too large for a {what}; choose another file"
        )


# What zipfile, zlib and numpy raise on damaged or hostile files.
UNREADABLE: tuple[type[Exception], ...] = (
    OSError,
    EOFError,
    LookupError,
    ValueError,
    TypeError,
    ArithmeticError,
    RuntimeError,
    MemoryError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    SyntaxError,  # this and the next: a header that is no Python literal
    tokenize.TokenError,
)
_HEADER_READERS: dict[tuple[int, int], Any] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def is_archive(path: Path) -> bool:
    """Return whether a file begins as a zip archive; False for what is no file.

    ``zipfile.is_zipfile`` takes an archive that cannot be read for none.

    :raises OSError: the file cannot be read.
    """
    if not path.is_file():  # opening a pipe would wait for a writer
        return False
    with path.open("rb") as file:
        return file.read(len(_ARCHIVE)) == _ARCHIVE


def npz_keys(path: Path, error: type[InputError], what: str) -> set[str]:
    """Return the names of the arrays in a .npz file; empty when it is not a zip file at all.

    :param error: class of what is raised.
    :param what: what the file should be, for the message, e.g. ``motion file``.
    :raises InputError: as `error`, when the file cannot be read.
    """
    try:
        if not is_archive(path):
            return set()
        with zipfile.ZipFile(path) as archive:
            return {name.removesuffix(".npy") for name in archive.namelist()}
    except UNREADABLE as cause:
        raise error(
            f"{path} is not a readable {what} ({in_one_line(cause)}); choose another file"
        ) from cause


def read_header(file: IO[bytes], key: str) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return the shape of an array in numpy's format, whether it is in the order of Fortran, and
    its type.

    :param key: what the array is called in messages.
    :raises ModelFileError: the format is of a version that numpy does not use for plain arrays.
    """
    version = np.lib.format.read_magic(file)  # type: ignore[no-untyped-call]
    if version not in _HEADER_READERS:
        raise ModelFileError(
            f"{key} is stored in version {version} of numpy's format; save it with a current numpy"
        )
    return _HEADER_READERS[version](file)


LARGEST_BYTES = 4 << 30  # unpacked; an hour of SMPL+H motion at 60 fps takes a quarter of this


def read_npz(
    path: Path,
    error: type[InputError],
    what: str,
    content: bytes | None = None,
    wanted: Collection[str] | None = None,
) -> dict[str, NDArray[Any]]:
    """Return all arrays of a .npz file, never unpickling.

    :param error: class raised for a missing, broken, oversized or pickled file.
    :param what: what the file should have been, for the message, e.g. ``motion file``.
    :param content: the file's bytes if they are not on disk; ``path`` then only names them in
        messages.
    :param wanted: the arrays to read, if they are present; the others may hold anything. All if
        None.
    :raises InputError: as `error`, when the file cannot be read, would be too large or holds
        pickled objects.
    """
    if content is None:
        check_regular(path, error, what, LARGEST_BYTES)
    source = path if content is None else io.BytesIO(content)
    try:
        with zipfile.ZipFile(source) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if isinstance(source, io.BytesIO):
            source.seek(0)  # numpy looks for the file's kind where it is, not at the beginning
        if size > LARGEST_BYTES:
            raise error(f"{path} would unpack to {size >> 20} MiB, too large for a {what}")
        with np.load(source, allow_pickle=False) as file:
            keys = [key for key in file.files if wanted is None or key in wanted]
            arrays = {key: file[key] for key in keys}
        if any(isinstance(array, bytes) for array in arrays.values()):
            raise ValueError("a member is not in numpy's format")
        return arrays
    except FileNotFoundError as cause:
        raise error(f"{path} does not exist; choose an existing {what}") from cause
    except UNREADABLE as cause:
        raise error(
            f"{path} is not a readable {what} ({in_one_line(cause)}); choose another file"
        ) from cause
