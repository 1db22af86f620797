# SPDX-License-Identifier: GPL-3.0-or-later
"""Check a binary FBX file before Blender's importer reads it, which unpacks whatever its arrays
hold.

A file is a tree of nodes: end offset, number and size of properties, name, properties, children. A
property is a letter for its type and a value; those of arrays have a number of elements, whether
they are compressed with zlib, and the size in the file. Source: the description of the format by
the Blender developers (Binary FBX file structure, 2013).
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from ...solver.errors import InputError
from .bone_map import check_bone_count

_HEADER_BYTES = 27
_BONES = (b"LimbNode", b"Limb")  # kinds of the nodes named Model
_SCALAR_BYTES = {"C": 1, "B": 1, "Y": 2, "I": 4, "F": 4, "D": 8, "L": 8}
_ELEMENT_BYTES = {"b": 1, "c": 1, "i": 4, "f": 4, "d": 8, "l": 8}
_LARGEST_UNPACKED = 1 << 30  # bytes of all arrays together
_MAX_NODES = 5_000_000
_DEEPEST = 64
_STEP = 1 << 20


def check_fbx(path: Path) -> None:
    """Check that nodes lie within the file, that arrays unpack to what they say, a gigabyte in all
    at most, and that there are not too many bones.

    :raises InputError: they do not.
    :raises OSError: the file cannot be read.
    """
    try:
        checker = _Checker(memoryview(path.read_bytes()))
        checker.check()
    except (ValueError, IndexError, struct.error, zlib.error) as error:
        raise InputError(
            f"{path}: this FBX file is damaged ({error}); export it again or choose another"
        ) from error
    check_bone_count(str(path), checker.bones)


class _Checker:
    def __init__(self, data: memoryview) -> None:
        self._data = data
        self._unpacked = self._nodes = 0
        self.bones = 0
        (version,) = struct.unpack_from("<I", data, 23)
        self._node = struct.Struct("<QQQB" if version >= 7500 else "<IIIB")

    def check(self) -> None:
        """Check everything.

        :raises ValueError: the file is damaged or too large; also struct.error, IndexError and
            zlib.error.
        """
        self._check_nodes(_HEADER_BYTES, len(self._data), 0)

    def _check_nodes(self, at: int, end: int, depth: int) -> None:
        """Check sibling nodes, the last of which is a record of zeros."""
        if depth > _DEEPEST:
            raise ValueError("its nodes are nested too deeply")
        while at < end:
            self._nodes += 1
            if self._nodes > _MAX_NODES:
                raise ValueError("it has too many nodes")
            node_end, count, size, name = self._node.unpack_from(self._data, at)
            if node_end == 0:
                return
            start = at + self._node.size + name
            if not start + size <= node_end <= end:
                raise ValueError("a node does not lie within its parent")
            self._check_properties(start, start + size, count)
            if bytes(self._data[start - name : start]) == b"Model":
                self.bones += bytes(self._data[start : start + size]).endswith(_BONES)
            self._check_nodes(start + size, node_end, depth + 1)
            at = node_end

    def _check_properties(self, at: int, end: int, count: int) -> None:
        for _ in range(count):
            kind = chr(self._data[at])
            at += 1
            if kind in _SCALAR_BYTES:
                at += _SCALAR_BYTES[kind]
            elif kind in _ELEMENT_BYTES:
                length, encoding, size = struct.unpack_from("<III", self._data, at)
                at += 12 + size
                if at > end:
                    raise ValueError("an array does not lie within its node")
                self._check_array(
                    at - size, at, length * _ELEMENT_BYTES[kind], compressed=encoding == 1
                )
            elif kind in "SR":
                at += 4 + struct.unpack_from("<I", self._data, at)[0]
            else:
                raise ValueError(f"it has a property of type {kind!r}")
            if at > end:
                raise ValueError("a property does not lie within its node")

    def _check_array(self, start: int, end: int, wanted: int, *, compressed: bool) -> None:
        self._unpacked += wanted
        if self._unpacked > _LARGEST_UNPACKED:
            raise ValueError("its arrays are too large")
        if not compressed:
            size = end - start
        else:
            unpack = zlib.decompressobj()
            size = 0
            rest = bytes(self._data[start:end])
            while rest and not unpack.eof and size <= wanted:
                size += len(unpack.decompress(rest, _STEP))
                rest = unpack.unconsumed_tail
        if size != wanted:
            raise ValueError("an array does not have the size that it declares")
