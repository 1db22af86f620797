# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length that phones write into their .mov and .mp4 files, and the length of an image
sequence in .avif and .heic.

QuickTime metadata: a ``meta`` box, of the movie (``moov``) or of a track (``trak``), holds ``keys``
(names) and ``ilst`` (values, numbered like the names). Damaged or unknown metadata counts as
absent. Phones write the focal length into the track, whose keys FFmpeg does not report.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

_KEY = b"com.apple.quicktime.camera.focal_length.35mm_equivalent"
_LARGEST_INDEX = 64 << 20  # bytes; an hour of video has an index of a few MB
# Data types of the QuickTime File Format, "Well-known types": code -> struct format of the
# big-endian number.
_NUMBERS = {
    23: ">f",
    24: ">d",
    65: ">b",
    66: ">h",
    67: ">i",
    74: ">q",
    75: ">B",
    76: ">H",
    77: ">I",
    78: ">Q",
}


def focal_35mm(path: Path) -> float | None:
    """Read the focal length in mm on a 36 × 24 mm frame; None if the file does not have it."""
    try:
        with path.open("rb") as file:
            moov = _find_moov(file)
        for meta in _metas(moov):
            value = _value(meta)
            if value is not None and 1 <= value <= 2000:
                return value
    except (OSError, struct.error, ValueError):
        pass
    return None


def sequence_length(path: Path) -> int:
    """Count the images of the first track of a file; 0 if it has none."""
    try:
        with path.open("rb") as file:
            box = _find_moov(file)
    except (OSError, struct.error):
        return 0
    for wanted in (b"trak", b"mdia", b"minf", b"stbl", b"stsz"):
        box = next((payload for name, payload in _boxes(box) if name == wanted), b"")
    return int.from_bytes(box[8:12], "big")


def _find_moov(file: BinaryIO) -> bytes:
    """Read the payload of the ``moov`` box, skipping the media data around it."""
    while len(head := file.read(8)) == 8:
        size, name = struct.unpack(">I4s", head)
        payload = size - 8
        if size == 1:
            payload = struct.unpack(">Q", file.read(8))[0] - 16
        if payload < 0 or not (name.isalnum() or name.strip().isalnum()):
            return b""
        if name == b"moov":
            return file.read(payload) if payload <= _LARGEST_INDEX else b""
        file.seek(payload, 1)
    return b""


def _boxes(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Iterate over the consecutive boxes in ``data``; yield name and payload."""
    at = 0
    while at + 8 <= len(data):
        size, name = struct.unpack_from(">I4s", data, at)
        if size < 8:
            return
        yield name, data[at + 8 : at + size]
        at += size


def _metas(moov: bytes) -> Iterator[bytes]:
    for name, payload in _boxes(moov):
        if name == b"meta":
            yield payload
        elif name == b"trak":
            yield from _metas(payload)


def _value(meta: bytes) -> float | None:
    if meta[:4] == b"\0\0\0\0":  # MP4 has a version here, QuickTime has none
        meta = meta[4:]
    parts = dict(_boxes(meta))
    # The names follow version and count, each after "mdta".
    names = [name for _, name in _boxes(parts.get(b"keys", b"")[8:])]
    for number, item in _boxes(parts.get(b"ilst", b"")):
        index = struct.unpack(">I", number)[0] - 1
        data = dict(_boxes(item)).get(b"data", b"")
        if 0 <= index < len(names) and names[index] == _KEY and len(data) > 8:
            return _number(struct.unpack_from(">I", data)[0], data[8:])
    return None


def _number(kind: int, value: bytes) -> float | None:
    if kind in (21, 22):  # integers of any length
        return float(int.from_bytes(value, "big", signed=kind == 21))
    if kind == 1:  # text
        # Apple documents "50.00mm"
        return float(value.decode("ascii", "replace").removesuffix("mm"))
    return float(struct.unpack(_NUMBERS[kind], value)[0]) if kind in _NUMBERS else None
