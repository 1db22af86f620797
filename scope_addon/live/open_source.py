# SPDX-License-Identifier: GPL-3.0-or-later
"""Where frames come from: a camera, a stream, or a file that is played in real time."""

from __future__ import annotations

import re
from pathlib import Path

from ..errors import OfflineError, VideoError
from .camera import CameraSource
from .source import FileSource, Source
from .stream import SCHEMES, StreamSource


def is_stream(text: str) -> bool:
    """Return whether the source that a text names is on the network, rather than a camera or a
    file.
    """
    return re.match(r"[A-Za-z][\w+.-]+:", text) is not None and "//" in text


def open_source(text: str, *, online: bool = True) -> Source:
    """Return the source that a text names: a camera's number or device, a URL, or a file.

    :param online: whether the network may be used.
    :raises VideoError: it is none of these, or a stream that may not be used.
    """
    if re.fullmatch(r"\d{1,3}", text):
        return CameraSource(int(text))
    if re.match(r"/dev/video\d+$", text):
        return CameraSource(text)
    if is_stream(text):
        scheme = text.partition(":")[0]
        if scheme.lower() not in SCHEMES:
            raise VideoError(
                f"{text}: '{scheme}' is not a kind of stream that can be read; use "
                f"{', '.join(SCHEMES)}"
            )
        if not online:
            raise OfflineError
        return StreamSource(text)
    if not Path(text).exists():
        raise VideoError(
            f"{text} does not exist; check the path, give a camera as a number such as 0, and a "
            "stream with its kind, as in rtsp://192.168.1.20/stream"
        )
    return FileSource(Path(text))
