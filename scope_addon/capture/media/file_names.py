# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening files whose names are not UTF-8, at which OpenCV's functions end the process with a
segmentation fault.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ...errors import VideoError
from ...footage import display_text, is_utf8
from ...temporary import temporary_folder


@contextmanager
def utf8_name(path: Path) -> Iterator[str]:
    """Give an absolute name of an existing file that a library in C or C++ can take, to open it
    within the context.

    :return: context manager that gives the file's own name, or that of a link to it.
    :raises VideoError: no link can be made.
    """
    absolute = path.absolute()
    if is_utf8(absolute):
        yield str(absolute)
        return
    with temporary_folder("name") as folder:
        link = folder / f"file{path.suffix if is_utf8(path.suffix) else ''}"
        try:
            link.symlink_to(absolute)
        except OSError as error:
            raise VideoError(
                f"the name of {display_text(path)} is not UTF-8, so it cannot be opened; rename it"
            ) from error
        yield str(link)
