# SPDX-License-Identifier: GPL-3.0-or-later
"""Metadata of a picture file: orientation, focal length, and whether it is an animation.

EXIF is a TIFF directory: the whole of a .tif, the APP1 segment of a JPEG, the eXIf chunk of a PNG,
the EXIF chunk of a WebP. Damaged EXIF counts as absent: the picture can still be used.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from .footage import MAX_PICTURE_BYTES
from .footage_view import AS_IN_FILE, FootageView

PNG = b"\x89PNG\r\n\x1a\n"  # begins the file
TIFF = (b"II*\0", b"MM\0*")  # one of these does; a TIFF of more than 4 GB would begin otherwise
# Tag numbers of TIFF 6.0; directories have them in increasing order.
_KIND = 0x00FE
_IS_REDUCED = 1
_MAX_DIRECTORIES = 10_000
_WIDTH = 0x0100
_HEIGHT = 0x0101
_BITS = 0x0102
_DEEPEST = 64  # bits of one channel
# Tag numbers of the EXIF 2.3 standard.
_ORIENTATION = 0x0112
_EXIF_DIRECTORY = 0x8769
_FOCAL_35MM = 0xA405
_VIEWS = {  # how a picture is shown, by its orientation
    1: AS_IN_FILE,
    2: FootageView(0, True),
    3: FootageView(180),
    4: FootageView(180, True),
    5: FootageView(90, True),
    6: FootageView(90),
    7: FootageView(270, True),
    8: FootageView(270),
}
_INTEGER = {3: "H", 4: "I"}  # TIFF field types SHORT and LONG


@dataclass(frozen=True)
class Exif:
    """``orientation`` 1..8 as EXIF numbers them (1: upright); ``focal_35mm`` in mm on a 36 × 24 mm
    frame, or None.
    """

    orientation: int = 1
    focal_35mm: float | None = None

    @property
    def view(self) -> FootageView:
        """How the stored picture is turned and mirrored to be shown."""
        return _VIEWS[self.orientation]


def read_exif(data: bytes) -> Exif:
    """Read the orientation and the focal length of an encoded picture (the bytes of the file)."""
    try:
        tiff = _find_tiff(data)
        return _parse(tiff) if tiff else Exif()
    except (struct.error, IndexError):
        return Exif()


def picture_view(path: Path) -> FootageView:
    """Return how the EXIF orientation of a picture file turns it; not at all where the file cannot
    be read, or is larger than a capture accepts.
    """
    try:
        if path.stat().st_size > MAX_PICTURE_BYTES:
            return AS_IN_FILE
        data = path.read_bytes()
    except OSError:
        return AS_IN_FILE
    return read_exif(data).view


def animation_length(data: bytes) -> int:
    """Count the frames of an animated PNG or WebP, or the pages of a TIFF; 1 for every other
    picture.
    """
    if data.startswith(TIFF):
        return max(1, _tiff_pages(data))
    if data.startswith(PNG):
        control = next((content for name, content, _ in png_chunks(data) if name == b"acTL"), b"")
        return max(1, int.from_bytes(control[:4], "big"))
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return max(1, sum(name == b"ANMF" for name, _ in _riff_chunks(data)))
    return 1


def tiff_size(data: bytes) -> tuple[int, int, int]:
    """Read the size of a TIFF's first image: width and height in pixels, 0 if not stated, and bits
    of a channel.

    A tag that is repeated counts with its largest value, and a depth that cannot be read as 64
    bits, the largest.
    """
    endian = "<" if data[:1] == b"I" else ">"
    found = {_WIDTH: 0, _HEIGHT: 0, _BITS: 1}
    try:
        at = struct.unpack_from(endian + "I", data, 4)[0]
        for tag, kind, count, place in _entries(data, at, endian):
            if tag not in found:
                continue
            value = _DEEPEST if tag == _BITS else 0
            if kind in _INTEGER and count > 0:
                if count * struct.calcsize(_INTEGER[kind]) > 4:
                    place = struct.unpack_from(endian + "I", data, place)[0]
                value = struct.unpack_from(endian + _INTEGER[kind], data, place)[0]
            found[tag] = max(found[tag], value)
    except struct.error:
        found[_BITS] = _DEEPEST
    return found[_WIDTH], found[_HEIGHT], found[_BITS]


def _tiff_pages(data: bytes) -> int:
    """Count the images of a TIFF, without those that are another one at a lower resolution."""
    endian = "<" if data[:1] == b"I" else ">"
    directories: set[int] = set()
    pages = 0
    try:
        at = struct.unpack_from(endian + "I", data, 4)[0]
        while at and at not in directories and len(directories) < _MAX_DIRECTORIES:
            directories.add(at)
            entries, first_tag = struct.unpack_from(endian + "HH", data, at)
            kind = struct.unpack_from(endian + "I", data, at + 10)[0] if first_tag == _KIND else 0
            pages += not kind & _IS_REDUCED
            at = struct.unpack_from(endian + "I", data, at + 2 + 12 * entries)[0]
    except struct.error:
        pass
    return pages


def _find_tiff(data: bytes) -> bytes:
    if data[:2] == b"\xff\xd8":
        return _jpeg_app1(data)
    if data.startswith(PNG):
        return next((content for name, content, _ in png_chunks(data) if name == b"eXIf"), b"")
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        found = next((d for name, d in _riff_chunks(data) if name == b"EXIF"), b"")
        return found[6:] if found[:6] == b"Exif\0\0" else found
    return data if data.startswith(TIFF) else b""


def _jpeg_app1(data: bytes) -> bytes:
    at = 2
    # 0xDA: start of the image data
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != 0xDA:
        length = struct.unpack_from(">H", data, at + 2)[0]
        if data[at + 1] == 0xE1 and data[at + 4 : at + 10] == b"Exif\0\0":
            return data[at + 10 : at + 2 + length]
        at += 2 + length
    return b""


def png_chunks(data: bytes) -> Iterator[tuple[bytes, bytes, int]]:
    """Iterate over the chunks of a PNG, stored as (size, name, content, checksum).

    :return: name, content, and the size that the content should have: it ends where the file does.
    """
    at = len(PNG)
    while at + 8 <= len(data):
        size = int.from_bytes(data[at : at + 4], "big")
        yield data[at + 4 : at + 8], data[at + 8 : at + 8 + size], size
        at += 12 + size


def _riff_chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Iterate over the chunks of a WebP, stored as (name, size, data, padding to an even size);
    yield name and data.
    """
    at = 12
    while at + 8 <= len(data):
        size = int.from_bytes(data[at + 4 : at + 8], "little")
        yield data[at : at + 4], data[at + 8 : at + 8 + size]
        at += 8 + size + size % 2


def _parse(tiff: bytes) -> Exif:
    endian = {b"II": "<", b"MM": ">"}[tiff[:2]] if tiff[:2] in (b"II", b"MM") else ""
    if not endian:
        return Exif()
    tags = _directory(tiff, struct.unpack_from(endian + "I", tiff, 4)[0], endian)
    if _EXIF_DIRECTORY in tags:
        tags |= _directory(tiff, tags[_EXIF_DIRECTORY], endian)
    orientation = tags.get(_ORIENTATION, 1)
    focal = tags.get(_FOCAL_35MM, 0)
    return Exif(orientation if 1 <= orientation <= 8 else 1, float(focal) if focal > 0 else None)


def _directory(tiff: bytes, at: int, endian: str) -> dict[int, int]:
    """Read the integer tags of one TIFF directory."""
    return {
        tag: struct.unpack_from(endian + _INTEGER[kind], tiff, place)[0]
        for tag, kind, count, place in _entries(tiff, at, endian)
        if kind in _INTEGER and count == 1
    }


def _entries(tiff: bytes, at: int, endian: str) -> Iterator[tuple[int, int, int, int]]:
    """Iterate over the entries of a TIFF directory, which are 12 bytes: tag, type, count, value;
    yield the first three, and where the value is.
    """
    for i in range(struct.unpack_from(endian + "H", tiff, at)[0]):
        entry = at + 2 + 12 * i
        tag, kind, count = struct.unpack_from(endian + "HHI", tiff, entry)
        yield tag, kind, count, entry + 8
