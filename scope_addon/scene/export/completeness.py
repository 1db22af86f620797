# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether Blender has written a file to its end: some of its writers do not report that a write
failed.
"""

from __future__ import annotations

import struct
from pathlib import Path

import bpy

_CRATE = b"PXR-USDC"
_SECTION = struct.Struct("<16sqq")  # name, start, size
_ZSTANDARD = b"\x28\xb5\x2f\xfd"
# magic numbers around the table of a seekable Zstandard file
_TABLE = 0x184D2A5E
_TABLE_END = 0x8F92EAB1
_HAS_CHECKSUMS = 0x80


def is_whole_crate(path: Path) -> bool:
    """Return whether a USD crate file has its table of contents, and more than the root of the
    scene.

    The table is written last and located by the header. The exporter writes the file first without
    and then with the scene.

    Source: OpenUSD, pxr/usd/usd/crateFile.h: identifier (8 bytes), version (8), offset of the table
    (8); the table is a count (8) of sections of 32 bytes each; the section of paths begins with
    their count (8).
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(24)
        if len(head) < 24 or head[:8] != _CRATE:
            return False
        (table,) = struct.unpack("<q", head[16:])
        if not 24 <= table <= size - 8:
            return False
        file.seek(table)
        (count,) = struct.unpack("<q", file.read(8))
        if not 0 < count <= (size - table - 8) // _SECTION.size:
            return False
        sections = [_SECTION.unpack(file.read(_SECTION.size)) for _ in range(count)]
        starts = [start for name, start, _ in sections if name.rstrip(b"\0") == b"PATHS"]
        if not starts or not 0 <= starts[0] <= size - 8:
            return False
        file.seek(starts[0])
        (paths,) = struct.unpack("<q", file.read(8))
    return bool(paths > 1)


def is_whole_blend(path: Path) -> bool:
    """Return whether a .blend file is as long as its own table says, and Blender finds its end."""
    if not _has_all_frames(path):
        return False
    try:
        with bpy.data.libraries.load(str(path)):
            return True
    except OSError:
        return False


def _has_all_frames(path: Path) -> bool:
    """Return whether the compressed parts of a .blend fill the file; True if it is not compressed.

    Source: Zstandard, contrib/seekable_format: the file ends with a frame that lists the compressed
    and the full size of every other one, their number, a byte of flags and a magic number.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(4) != _ZSTANDARD:
            return True  # whether it is a .blend at all, Blender says
        if size < 17:
            return False
        file.seek(size - 9)
        count, flags, magic = struct.unpack("<IBI", file.read(9))
        entry = 12 if flags & _HAS_CHECKSUMS else 8
        start = size - 17 - count * entry
        if magic != _TABLE_END or start < 0:
            return False
        file.seek(start)
        if struct.unpack("<I", file.read(4))[0] != _TABLE:
            return False
        file.seek(4, 1)
        table = file.read(count * entry)
    return bool(sum(struct.unpack_from("<I", table, k * entry)[0] for k in range(count)) == start)
