# SPDX-License-Identifier: GPL-3.0-or-later
"""The primary picture of a HEIF file (.heic, .avif): of which items it is made, how it is turned, and its EXIF.

A file has items: coded pictures, grids made of them (phones code pictures in tiles), thumbnails, depth, EXIF. Which one
is the picture, and how the others belong to it, is told by boxes within its ``meta`` box. Decoders give the items that
are coded; what a grid makes of them is here. Crops (``clap``) and overlays (``iovl``) are not known. PyAV does
not say how tiles belong together, and libheif's packages for Python can crash where a file's boxes are damaged.

Sources: ISO/IEC 23008-12 (items, grids, irot, imir), ISO/IEC 14496-12 (boxes, iloc, iinf, iref).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

CODED = (b"hvc1", b"av01")
MOST_TILES = 1000  # as many as ffmpeg opens
MOST_PIXELS = 1 << 28  # more than any camera has; a few bytes of a hostile file can ask for any number
_MOST_BOXES = 10_000  # of one level; a file that has more is not a picture
_MOST_PARTS = 20_000  # in which the items of a file lie, together
_MOST_TURNS = 16


@dataclass(frozen=True)
class Layout:
    """How the picture is made. ``tiles`` (rows, columns) numbers of items; ``size`` (width, height) of what they hold.

    ``size`` is None for a picture in one piece. ``turns`` are what is done with the whole, in order: ("irot", quarter
    turns anticlockwise) or ("imir", 0: upside down, 1: left for right). ``exif`` is a TIFF directory, or empty.
    """

    tiles: np.ndarray
    size: tuple[int, int] | None
    turns: tuple[tuple[str, int], ...] = ()
    exif: bytes = b""


def read_layout(data: bytes) -> Layout | None:
    """The layout of a whole file's primary picture; None where it is damaged, or of a kind that is not known."""
    try:
        return _Items(data).layout()
    except (struct.error, IndexError, KeyError, ValueError, StopIteration):
        return None


def assemble(layout: Layout, pictures: Mapping[int, np.ndarray]) -> np.ndarray | None:
    """The upright picture (H, W, 3) of decoded items (h, w, 3); None where they do not fit each other."""
    if any(number not in pictures for number in layout.tiles.ravel().tolist()):
        return None
    shape = pictures[int(layout.tiles[0, 0])].shape
    tall, wide = shape[:2]
    rows, columns = layout.tiles.shape
    width, height = (wide, tall) if layout.size is None else layout.size
    if not ((rows - 1) * tall < height <= rows * tall and (columns - 1) * wide < width <= columns * wide):
        return None
    whole = np.empty((height, width, 3), np.uint8)
    for (row, column), number in np.ndenumerate(layout.tiles):
        if pictures[number].shape != shape:
            return None
        place = whole[row * tall : (row + 1) * tall, column * wide : (column + 1) * wide]
        place[:] = pictures[number][: place.shape[0], : place.shape[1]]
    for kind, value in layout.turns:
        whole = np.rot90(whole, value) if kind == "irot" else np.flip(whole, axis=value)
    return np.ascontiguousarray(whole)


@dataclass
class _Item:
    kind: bytes = b""
    parts: list[tuple[int, int]] = field(default_factory=list)  # offset and length
    is_inside: bool = False  # offsets count from the idat box
    tiles: list[int] = field(default_factory=list)


class _Items:
    """The meta box of a file."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._items: dict[int, _Item] = {}
        start, end = next((a, b) for name, a, b in self._boxes(0, len(data)) if name == b"meta")
        boxes = {name: (a, b) for name, a, b in self._boxes(start + 4, end)}
        self._inside = boxes.get(b"idat", (0, 0))
        read = _Reader(data, *boxes[b"pitm"])
        self._primary = read.integer(2 if read.version == 0 else 4)
        self._read_kinds(*boxes[b"iinf"])
        self._read_places(_Reader(data, *boxes[b"iloc"]))
        self._about: list[tuple[int, int]] = []  # which item tells about which
        self._turns: list[tuple[str, int]] = []  # of the primary item
        if b"iref" in boxes:
            self._read_references(*boxes[b"iref"])
        if b"iprp" in boxes:
            self._read_turns(*boxes[b"iprp"])

    def layout(self) -> Layout:
        """Of the primary item."""
        item = self._items[self._primary]
        exif = b""
        tellers = [self._items.get(teller, _Item()) for teller, told in self._about if told == self._primary]
        teller = next((item for item in tellers if item.kind == b"Exif"), None)
        if teller is not None:
            content = self._content(teller)
            exif = content[4 + int.from_bytes(content[:4], "big") :]
        if item.kind in CODED:
            return Layout(np.array([[self._primary]]), None, tuple(self._turns), exif)
        if item.kind != b"grid":
            raise ValueError(item.kind)
        grid = self._content(item)
        rows, columns = grid[2] + 1, grid[3] + 1
        width, height = struct.unpack_from(">II" if grid[1] & 1 else ">HH", grid, 4)
        if not 0 < width * height <= MOST_PIXELS or rows * columns > MOST_TILES:
            raise ValueError("too large")
        tiles = np.array(item.tiles).reshape(rows, columns)
        if any(self._items[number].kind not in CODED for number in item.tiles):
            raise ValueError("tiles of another kind")
        return Layout(tiles, (width, height), tuple(self._turns), exif)

    def _boxes(self, start: int, end: int) -> Iterator[tuple[bytes, int, int]]:
        """Name, start and end of the content of each box of a level."""
        for _ in range(_MOST_BOXES):
            if start + 8 > end:
                return
            size, name, head = *struct.unpack_from(">I4s", self._data, start), 8
            if size == 1:
                size, head = struct.unpack_from(">Q", self._data, start + 8)[0], 16
            size = size or end - start  # 0: to the end
            if size < head or start + size > end:
                raise ValueError("a box does not fit")
            yield name, start + head, start + size
            start += size

    def _read_kinds(self, start: int, end: int) -> None:
        read = _Reader(self._data, start, end)
        read.integer(2 if read.version == 0 else 4)
        for name, a, b in self._boxes(read.at, end):
            if name == b"infe":
                entry = _Reader(self._data, a, b)
                number = entry.integer(4 if entry.version == 3 else 2)
                entry.integer(2)
                self._items[number] = _Item(entry.take(4))

    def _read_places(self, read: _Reader) -> None:
        sizes = read.integer(2)
        offset, length, base, index = (sizes >> shift & 15 for shift in (12, 8, 4, 0))
        wide, parts = read.version == 2, 0
        for _ in range(read.integer(4 if wide else 2)):
            item = self._items.setdefault(read.integer(4 if wide else 2), _Item())
            item.is_inside = bool(read.version and read.integer(2) & 15 == 1)
            read.integer(2)
            begin = read.integer(base)
            count = read.integer(2)
            parts += count
            if parts > _MOST_PARTS:
                raise ValueError("too many parts")
            for _ in range(count):
                read.integer(index if read.version else 0)
                item.parts.append((begin + read.integer(offset), read.integer(length)))

    def _read_references(self, start: int, end: int) -> None:
        size = 2 if _Reader(self._data, start, end).version == 0 else 4
        for name, a, b in self._boxes(start + 4, end):
            read = _Reader(self._data, a, b, is_full=False)
            number = read.integer(size)
            to = [read.integer(size) for _ in range(read.integer(2))]
            if name == b"dimg":
                self._items[number].tiles = to
            elif name == b"cdsc":
                self._about += [(number, other) for other in to]

    def _read_turns(self, start: int, end: int) -> None:
        boxes = list(self._boxes(start, end))
        a, b = next((a, b) for name, a, b in boxes if name == b"ipco")
        turning = (b"irot", b"imir")
        properties = [(name, self._data[at]) if name in turning else None for name, at, _ in self._boxes(a, b)]
        for a, b in ((a, b) for name, a, b in boxes if name == b"ipma"):
            read = _Reader(self._data, a, b)
            for _ in range(read.integer(4)):
                number = read.integer(2 if read.version == 0 else 4)
                for _ in range(read.integer(1)):
                    which = read.integer(2) & 0x7FFF if read.flags & 1 else read.integer(1) & 0x7F
                    turn = properties[which - 1] if which else None
                    if turn is not None and number == self._primary and len(self._turns) < _MOST_TURNS:
                        name, value = turn
                        self._turns.append((name.decode(), value & (3 if name == b"irot" else 1)))

    def _content(self, item: _Item) -> bytes:
        if sum(length for _, length in item.parts) > len(self._data):
            raise ValueError("an item is larger than the file")
        start, end = self._inside if item.is_inside else (0, len(self._data))
        return b"".join(self._data[start + at : min(start + at + length, end)] for at, length in item.parts)


class _Reader:
    """Integers of a box one after the other, big end first; ``is_full``: version and flags come first."""

    def __init__(self, data: bytes, start: int, end: int, is_full: bool = True) -> None:
        self._data, self.at, self._end = data, start, end
        self.version = self.integer(1) if is_full else 0
        self.flags = self.integer(3) if is_full else 0

    def integer(self, size: int) -> int:
        return int.from_bytes(self.take(size), "big")

    def take(self, size: int) -> bytes:
        if self.at + size > self._end:
            raise ValueError("a box ends early")
        self.at += size
        return self._data[self.at - size : self.at]
