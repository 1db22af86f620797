# SPDX-License-Identifier: GPL-3.0-or-later
"""What a video device of Linux can do, as its driver answers (linux/videodev2.h). Asking does not
switch a camera on.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

MAX_FORMATS = 16
_MAX_SIZES = 64
# the requests, and the layouts of the structures that they fill in
_QUERYCAP = 0x80685600
_ENUM_FMT = 0xC0405602
_ENUM_FRAMESIZES = 0xC02C564A
_CAPABILITY = "16s32s32sIII12x"
_FORMAT = "III32sI16x"
_SIZE = "III6I8x"
_CAPTURE = 1  # V4L2_CAP_VIDEO_CAPTURE and V4L2_BUF_TYPE_VIDEO_CAPTURE
_OF_THIS_NODE = 1 << 31  # the answer also says what this one of a camera's nodes can do
_DISCRETE = 1  # V4L2_FRMSIZE_TYPE_DISCRETE


def delivers_images(node: int) -> bool:
    """Return whether an open device gives pictures, unlike the node of a camera's metadata.

    :raises OSError: it is no video device, or gone.
    """
    answer = bytearray(struct.calcsize(_CAPABILITY))
    _ask(node, _QUERYCAP, answer)
    of_all, of_this = struct.unpack(_CAPABILITY, answer)[4:6]
    return bool((of_this if of_all & _OF_THIS_NODE else of_all) & _CAPTURE)


def pixel_formats(node: int) -> Iterator[tuple[bytes, tuple[int, int] | None]]:
    """Yield the four characters of each pixel format, and its largest size, if it says one."""
    for index in range(MAX_FORMATS):
        answer = bytearray(struct.pack(_FORMAT, index, _CAPTURE, 0, b"", 0))
        try:
            _ask(node, _ENUM_FMT, answer)
        except OSError:  # there are no more
            return
        code = struct.unpack(_FORMAT, answer)[4]
        size = max(_sizes(node, code), default=None, key=lambda size: size[0] * size[1])
        yield struct.pack("<I", code), size


def _sizes(node: int, code: int) -> Iterator[tuple[int, int]]:
    """Yield the sizes of a pixel format; the largest one of a continuous range."""
    for index in range(_MAX_SIZES):
        answer = bytearray(struct.pack(_SIZE, index, code, 0, *[0] * 6))
        try:
            _ask(node, _ENUM_FRAMESIZES, answer)
        except OSError:
            return
        values = struct.unpack(_SIZE, answer)
        if values[2] != _DISCRETE:  # minimum, maximum and step of width and of height
            yield values[4], values[7]
            return
        yield values[3], values[4]


def _ask(node: int, request: int, answer: bytearray) -> None:
    """Have a device fill in a structure.

    :raises OSError: it does not.
    """
    import fcntl  # which other systems do not have

    fcntl.ioctl(node, request, answer)
