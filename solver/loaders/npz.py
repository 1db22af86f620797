# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading .npz files that may come from anyone: plain arrays only, bounded size, one kind of
error.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .archive import UNREADABLE
from .regular_file import check_regular, in_one_line

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
        if size > LARGEST_BYTES:
            raise error(f"{path} would unpack to {size >> 20} MiB, too large for a {what}")
        with np.load(source, allow_pickle=False) as file:
            return {key: file[key] for key in file.files if wanted is None or key in wanted}
    except FileNotFoundError as cause:
        raise error(f"{path} does not exist; choose an existing {what}") from cause
    except UNREADABLE as cause:
        raise error(
            f"{path} is not a readable {what} ({in_one_line(cause)}); choose another file"
        ) from cause
