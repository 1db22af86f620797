# SPDX-License-Identifier: GPL-3.0-or-later
"""What is checked before a library opens a file: the size of an image, so that a malicious file can
take neither all memory nor all time, and its name, since OpenCV's functions end the process with a
segmentation fault at one that is not UTF-8.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ...errors import VideoError
from ...footage import MAX_PIXELS, display_text, is_utf8
from ...temporary import temporary_folder

# The largest ratio of the sides: the search for people takes time in proportion to it.
MAX_RATIO = 20.0


def check_size(path: Path, width: float, height: float) -> None:
    """Refuse an image that is too large or too long, from what its header says.

    :param width, height: of the image, in square pixels.
    :raises VideoError: it has more than `MAX_PIXELS` pixels, or its sides differ by more than a
        factor of `MAX_RATIO`.
    """
    if width * height > MAX_PIXELS:
        raise too_large(path, f"{width:.0f} × {height:.0f} pixels")
    shorter, longer = sorted((width, height))
    if longer > MAX_RATIO * max(shorter, 1):
        raise VideoError(
            f"{path} shows {width:.0f} × {height:.0f} pixels, and footage may be at most "
            f"{MAX_RATIO:.0f} times as long as it is wide; crop it around the person"
        )


def check_depth(path: Path, width: int, height: int, bits: int) -> None:
    """Refuse a still that takes more memory than one of `MAX_PIXELS` pixels with four channels of
    16 bits: 2.2 GB.

    :raises VideoError: it does.
    """
    # To decode the deeper ones, OpenCV takes three times their size, not twice.
    cost = 2 * bits if bits > 16 else 16
    if width * height * cost > 16 * MAX_PIXELS:
        raise too_large(path, f"{width} × {height} pixels of {bits} bits")


def too_large(path: Path, size: str) -> VideoError:
    """Make the error for an image with too many pixels."""
    return VideoError(
        f"{path} has {size}, and at most {MAX_PIXELS // 10**6} million can be read; scale it down, "
        "or crop it"
    )


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
