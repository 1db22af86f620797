# SPDX-License-Identifier: GPL-3.0-or-later
"""The primary picture of a HEIF file (.heic, .avif): its items, its rotation and its EXIF.

A file has items: coded pictures, grids of coded pictures (phones code pictures in tiles),
thumbnails, depth, EXIF. The boxes within its ``meta`` box identify the primary picture and its
relations to the other items. A decoder decodes the coded items; this module assembles a grid from
them. Crops (``clap``) and overlays (``iovl``) are not supported. PyAV does not report how tiles
belong together, and libheif's Python packages can crash if a file's boxes are damaged.

Sources: ISO/IEC 23008-12 (items, grids, irot, imir), ISO/IEC 14496-12 (boxes, iloc, iinf, iref).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...arrays import Uint8Array
from ...footage import MAX_PIXELS

CODED = (b"hvc1", b"av01")
MAX_TILES = 1000  # ffmpeg's limit
_MAX_BOXES = 10_000  # on one level; a file with more is not a picture
_MAX_EXTENTS = 20_000  # of all items of a file together
_MAX_TRANSFORMS = 16


@dataclass(frozen=True)
class Layout:
    """How the primary picture is assembled from items.

    ``tiles`` (rows, columns) item numbers; ``size`` (width, height) of the assembled picture, None
    if it is not a grid; ``transforms`` to apply to the whole in order: ("irot", number of 90°
    rotations anticlockwise) or ("imir", axis to flip: 0 vertical, 1 horizontal); ``exif``: a TIFF
    directory, or empty.
    """

    tiles: NDArray[np.int64]
    size: tuple[int, int] | None
    transforms: tuple[tuple[str, int], ...] = ()
    exif: bytes = b""


def read_layout(data: bytes) -> Layout | None:
    """Read the layout of the primary picture from the bytes of a file; None if it is damaged or not
    supported.
    """
    try:
        return _MetaBox(data).layout()
    except (struct.error, IndexError, KeyError, ValueError, StopIteration):
        return None


def assemble(layout: Layout, pictures: Mapping[int, Uint8Array]) -> Uint8Array | None:
    """Assemble the primary picture and rotate it upright.

    :param pictures: the decoded items by number, (h, w, 3) uint8 RGB.
    :return: (H, W, 3) uint8 RGB; None if an item is missing or the sizes do not match the layout.
    """
    if any(number not in pictures for number in layout.tiles.ravel().tolist()):
        return None
    shape = pictures[int(layout.tiles[0, 0])].shape
    tall, wide = shape[:2]
    rows, columns = layout.tiles.shape
    width, height = (wide, tall) if layout.size is None else layout.size
    if not (
        (rows - 1) * tall < height <= rows * tall and (columns - 1) * wide < width <= columns * wide
    ):
        return None
    whole = np.empty((height, width, 3), np.uint8)
    for (row, column), item in np.ndenumerate(layout.tiles):
        number = int(item)
        if pictures[number].shape != shape:
            return None
        target = whole[row * tall : (row + 1) * tall, column * wide : (column + 1) * wide]
        target[:] = pictures[number][: target.shape[0], : target.shape[1]]
    for kind, value in layout.transforms:
        whole = np.rot90(whole, value) if kind == "irot" else np.flip(whole, axis=value)
    return np.ascontiguousarray(whole)


@dataclass
class _Item:
    kind: bytes = b""
    extents: list[tuple[int, int]] = field(default_factory=list)  # offset and length
    is_in_idat: bool = False  # offsets are relative to the idat box
    tiles: list[int] = field(default_factory=list)


class _MetaBox:
    """Parser of the meta box of a file.

    :raises ValueError: it is damaged; also struct.error, IndexError, KeyError and StopIteration.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._items: dict[int, _Item] = {}
        start, end = next((a, b) for name, a, b in self._boxes(0, len(data)) if name == b"meta")
        boxes = {name: (a, b) for name, a, b in self._boxes(start + 4, end)}
        self._idat = boxes.get(b"idat", (0, 0))
        read = _Reader(data, *boxes[b"pitm"])
        self._primary = read.integer(2 if read.version == 0 else 4)
        self._read_kinds(*boxes[b"iinf"])
        self._read_locations(_Reader(data, *boxes[b"iloc"]))
        self._descriptions: list[tuple[int, int]] = []  # describing item, described item
        self._transforms: list[tuple[str, int]] = []  # of the primary item
        if b"iref" in boxes:
            self._read_references(*boxes[b"iref"])
        if b"iprp" in boxes:
            self._read_transforms(*boxes[b"iprp"])

    def layout(self) -> Layout:
        """Read the layout of the primary item.

        :raises ValueError: it is damaged, too large or not supported; also struct.error, IndexError
            and KeyError.
        """
        item = self._items[self._primary]
        exif = b""
        metadata = [
            self._items.get(number, _Item())
            for number, of in self._descriptions
            if of == self._primary
        ]
        exif_item = next((item for item in metadata if item.kind == b"Exif"), None)
        if exif_item is not None:
            content = self._content(exif_item)
            exif = content[4 + int.from_bytes(content[:4], "big") :]
        if item.kind in CODED:
            return Layout(np.array([[self._primary]]), None, tuple(self._transforms), exif)
        if item.kind != b"grid":
            raise ValueError(f"items of type {item.kind!r} are not supported")
        grid = self._content(item)
        rows = grid[2] + 1
        columns = grid[3] + 1
        width, height = struct.unpack_from(">II" if grid[1] & 1 else ">HH", grid, 4)
        if not 0 < width * height <= MAX_PIXELS or rows * columns > MAX_TILES:
            raise ValueError("the grid is empty or too large")
        tiles = np.array(item.tiles).reshape(rows, columns)
        if any(self._items[number].kind not in CODED for number in item.tiles):
            raise ValueError("a tile is not a coded picture")
        return Layout(tiles, (width, height), tuple(self._transforms), exif)

    def _boxes(self, start: int, end: int) -> Iterator[tuple[bytes, int, int]]:
        """Iterate over the boxes of one level; yield name, start and end of the content."""
        for _ in range(_MAX_BOXES):
            if start + 8 > end:
                return
            size, name, header = *struct.unpack_from(">I4s", self._data, start), 8
            if size == 1:
                size = struct.unpack_from(">Q", self._data, start + 8)[0]
                header = 16
            size = size or end - start  # 0: up to the end
            if size < header or start + size > end:
                raise ValueError("a box does not fit into its parent")
            yield name, start + header, start + size
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

    def _read_locations(self, read: _Reader) -> None:
        sizes = read.integer(2)
        offset, length, base, index = (sizes >> shift & 15 for shift in (12, 8, 4, 0))
        is_wide = read.version == 2
        extents = 0
        for _ in range(read.integer(4 if is_wide else 2)):
            item = self._items.setdefault(read.integer(4 if is_wide else 2), _Item())
            item.is_in_idat = bool(read.version and read.integer(2) & 15 == 1)
            read.integer(2)
            begin = read.integer(base)
            count = read.integer(2)
            extents += count
            if extents > _MAX_EXTENTS:
                raise ValueError("too many extents")
            for _ in range(count):
                read.integer(index if read.version else 0)
                item.extents.append((begin + read.integer(offset), read.integer(length)))

    def _read_references(self, start: int, end: int) -> None:
        size = 2 if _Reader(self._data, start, end).version == 0 else 4
        for name, a, b in self._boxes(start + 4, end):
            read = _Reader(self._data, a, b, is_full=False)
            number = read.integer(size)
            to = [read.integer(size) for _ in range(read.integer(2))]
            if name == b"dimg":
                self._items[number].tiles = to
            elif name == b"cdsc":
                self._descriptions += [(number, other) for other in to]

    def _read_transforms(self, start: int, end: int) -> None:
        boxes = list(self._boxes(start, end))
        a, b = next((a, b) for name, a, b in boxes if name == b"ipco")
        supported = (b"irot", b"imir")
        properties = [
            (name, self._data[at]) if name in supported else None
            for name, at, _ in self._boxes(a, b)
        ]
        for a, b in ((a, b) for name, a, b in boxes if name == b"ipma"):
            read = _Reader(self._data, a, b)
            for _ in range(read.integer(4)):
                number = read.integer(2 if read.version == 0 else 4)
                for _ in range(read.integer(1)):
                    which = read.integer(2) & 0x7FFF if read.flags & 1 else read.integer(1) & 0x7F
                    transform = properties[which - 1] if which else None
                    if (
                        transform is not None
                        and number == self._primary
                        and len(self._transforms) < _MAX_TRANSFORMS
                    ):
                        name, value = transform
                        self._transforms.append(
                            (name.decode(), value & (3 if name == b"irot" else 1))
                        )

    def _content(self, item: _Item) -> bytes:
        if sum(length for _, length in item.extents) > len(self._data):
            raise ValueError("an item is larger than the file")
        start, end = self._idat if item.is_in_idat else (0, len(self._data))
        return b"".join(
            self._data[start + at : min(start + at + length, end)] for at, length in item.extents
        )


class _Reader:
    """Reads the big-endian integers of a box in order; ``is_full``: the box begins with version and
    flags.
    """

    def __init__(self, data: bytes, start: int, end: int, is_full: bool = True) -> None:
        self._data = data
        self.at = start
        self._end = end
        self.version = self.integer(1) if is_full else 0
        self.flags = self.integer(3) if is_full else 0

    def integer(self, size: int) -> int:
        return int.from_bytes(self.take(size), "big")

    def take(self, size: int) -> bytes:
        if self.at + size > self._end:
            raise ValueError("a box ends early")
        self.at += size
        return self._data[self.at - size : self.at]
