# SPDX-License-Identifier: GPL-3.0-or-later
"""HEIC files like those of phones: pictures coded in one piece or in tiles, rotated, with EXIF."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from fractions import Fraction
from functools import cache

import numpy as np

from ..required import need_encoder, package

# kinds of HEVC's units
_PARAMETERS = (32, 33, 34)
_SEQUENCE_PARAMETERS = 33


def box(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content) + 8) + name + content


def full_box(name: bytes, content: bytes, version: int = 0, flags: int = 0) -> bytes:
    return box(name, struct.pack(">I", version << 24 | flags) + content)


def coded(picture_rgb: np.ndarray) -> tuple[bytes, bytes]:
    """Return the decoder's configuration (hvcC box, ISO 14496-15) and the coded picture, by
    x265.
    """
    return _coded(picture_rgb.tobytes(), picture_rgb.shape)


@cache
def _coded(pixels: bytes, shape: tuple[int, ...]) -> tuple[bytes, bytes]:
    picture_rgb = np.frombuffer(pixels, np.uint8).reshape(shape)
    av = package("av")
    need_encoder("libx265")
    encoder = av.CodecContext.create("libx265", "w")
    encoder.width = picture_rgb.shape[1]
    encoder.height = picture_rgb.shape[0]
    encoder.pix_fmt = "yuv444p"
    encoder.time_base = Fraction(1)
    encoder.options = {"crf": "8", "x265-params": "log-level=none:repeat-headers=1"}
    frame = av.VideoFrame.from_ndarray(picture_rgb, "rgb24")
    stream = b"".join(bytes(packet) for packet in [*encoder.encode(frame), *encoder.encode()])
    units = [unit for unit in re.split(b"\0?\0\0\x01", stream) if unit]
    kinds = [unit[0] >> 1 & 63 for unit in units]
    headers = [(kind, unit) for kind, unit in zip(kinds, units, strict=True) if kind in _PARAMETERS]
    profile = next(unit for kind, unit in headers if kind == _SEQUENCE_PARAMETERS)[3:15]
    arrays = b"".join(
        struct.pack(">BHH", 0x80 | kind, 1, len(unit)) + unit for kind, unit in headers
    )
    said = (
        b"\x01"
        + profile
        + struct.pack(">HBBBBHBB", 0xF000, 0xFC, 0xFF, 0xF8, 0xF8, 0, 0x0F, len(headers))
        + arrays
    )
    slices = [unit for kind, unit in zip(kinds, units, strict=True) if kind < 32]
    return box(b"hvcC", said), b"".join(struct.pack(">I", len(unit)) + unit for unit in slices)


def heic(
    picture_rgb: np.ndarray,
    tile: int | None = None,
    turns: Sequence[tuple[str, int]] = (),
    focal_mm: int | None = None,
    brands: bytes = b"heic\0\0\0\0mif1heic",
    grid: bytes | None = None,
    is_inside: bool = False,
) -> bytes:
    """Build a file. ``tile``: side of the tiles; a thumbnail comes first.

    ``grid``: the content of the grid item instead; ``is_inside``: in the idat box.
    """
    height, width = picture_rgb.shape[:2]
    if tile is None:
        rows = 1
        columns = 1
        pieces = [picture_rgb]
    else:
        rows = -(-height // tile)
        columns = -(-width // tile)
        whole = np.pad(
            picture_rgb,
            ((0, rows * tile - height), (0, columns * tile - width), (0, 0)),
            mode="edge",
        )
        pieces = [
            whole[r * tile : (r + 1) * tile, c * tile : (c + 1) * tile]
            for r in range(rows)
            for c in range(columns)
        ]
    small = np.full((64, 64, 3), 128, np.uint8)
    data = [coded(np.ascontiguousarray(piece)) for piece in (small, *pieces)]
    kinds = [b"hvc1"] * len(data)
    contents = [content for _, content in data]
    numbers = list(range(1, len(data) + 1))  # 1 is the thumbnail
    primary = 2
    references = b""
    if tile is not None:
        primary = len(numbers) + 1
        numbers = [*numbers, primary]
        kinds = [*kinds, b"grid"]
        tiles = numbers[1:-1]
        references += box(b"dimg", struct.pack(f">HH{len(tiles)}H", primary, len(tiles), *tiles))
        contents.append(grid or struct.pack(">BBBBHH", 0, 0, rows - 1, columns - 1, width, height))
    references += box(b"thmb", struct.pack(">HHH", 1, 1, primary))
    if focal_mm is not None:
        number = numbers[-1] + 1
        numbers = [*numbers, number]
        kinds = [*kinds, b"Exif"]
        references += box(b"cdsc", struct.pack(">HHH", number, 1, primary))
        directory = struct.pack(">HHHIHHI", 1, 0x8769, 4, 1, 0, 0, 0)[:10] + struct.pack(
            ">II", 26, 0
        )
        inner = struct.pack(">HHHIHHI", 1, 0xA405, 3, 1, focal_mm, 0, 0)
        contents.append(
            struct.pack(">I", 6) + b"Exif\0\0" + b"MM\0*" + struct.pack(">I", 8) + directory + inner
        )
    properties: list[bytes] = []
    associations: dict[int, list[int]] = {number: [] for number in numbers}

    def tell(number: int, property_box: bytes) -> None:
        properties.append(property_box)
        associations[number].append(len(properties))

    for number, (configuration, _), piece in zip(numbers, data, (small, *pieces), strict=False):
        tell(number, configuration)
        tell(number, full_box(b"ispe", struct.pack(">II", piece.shape[1], piece.shape[0])))
    if tile is not None:
        tell(primary, full_box(b"ispe", struct.pack(">II", width, height)))
    for kind, value in turns:
        tell(primary, box(kind.encode(), bytes([value])))
    said = b"".join(
        struct.pack(f">HB{len(w)}B", number, len(w), *w) for number, w in associations.items()
    )
    kinds_box = struct.pack(">H", len(numbers)) + b"".join(
        full_box(b"infe", struct.pack(">HH4s", number, 0, kind) + b"\0", version=2)
        for number, kind in zip(numbers, kinds, strict=True)
    )

    inside = [is_inside and kind == b"grid" for kind in kinds]
    idat = b"".join(content for content, within in zip(contents, inside, strict=True) if within)

    def meta(places: Sequence[tuple[int, int]]) -> bytes:
        located = b"".join(
            struct.pack(">HHHHII", number, within, 0, 1, at, length)
            for number, within, (at, length) in zip(numbers, inside, places, strict=True)
        )
        return full_box(
            b"meta",
            full_box(b"hdlr", bytes(4) + b"pict" + bytes(13))
            + full_box(b"pitm", struct.pack(">H", primary))
            + full_box(b"iloc", struct.pack(">HH", 0x4400, len(numbers)) + located, version=1)
            + full_box(b"iinf", kinds_box)
            + full_box(b"iref", references)
            + box(
                b"iprp",
                box(b"ipco", b"".join(properties))
                + full_box(b"ipma", struct.pack(">I", len(associations)) + said),
            )
            + box(b"idat", idat),
        )

    begin = box(b"ftyp", brands)
    at = len(begin) + len(meta([(0, 0)] * len(numbers))) + 8
    places = []
    for content, within in zip(contents, inside, strict=True):
        places.append((0 if within else at, len(content)))
        at += 0 if within else len(content)
    return (
        begin
        + meta(places)
        + box(
            b"mdat",
            b"".join(
                content for content, within in zip(contents, inside, strict=True) if not within
            ),
        )
    )
