# SPDX-License-Identifier: GPL-3.0-or-later
"""A small bounds-checked reader of FlatBuffers tables.

A table begins with a signed 32-bit distance back to its vtable; the vtable holds its own size, the table's size and one
16-bit offset per field (0: absent). Strings, vectors and sub-tables are reached through unsigned 32-bit distances.
Format: https://flatbuffers.dev/internals. The file may be hostile: every read is checked against the buffer.
"""

import struct

import numpy as np

from ...solver.errors import ModelFileError


class Buffer:
    """The bytes of one file, with checked reads; ``name`` is for messages."""

    def __init__(self, data: bytes, name: str) -> None:
        self.data = data
        self.name = name

    def read(self, fmt: str, position: int) -> int:
        """One little-endian scalar of struct format ``fmt`` at ``position``."""
        size = struct.calcsize(fmt)
        if position < 0 or position + size > len(self.data):
            raise ModelFileError(f"{self.name}: broken FlatBuffer, cannot read {size} bytes at {position}.")
        return struct.unpack_from("<" + fmt, self.data, position)[0]

    def root(self, identifier: bytes) -> "Table":
        """The root table, after checking the four-byte file identifier."""
        if self.data[4:8] != identifier:
            raise ModelFileError(f"{self.name}: not a {identifier.decode()} FlatBuffer; fetch the file again.")
        return Table(self, self.read("I", 0))


class Table:
    """One table at an absolute position; fields are addressed by their number in the schema."""

    def __init__(self, buffer: Buffer, position: int) -> None:
        self.buffer = buffer
        self.position = position
        self._vtable = position - buffer.read("i", position)
        self._vtable_size = buffer.read("H", self._vtable)

    def _field(self, number: int) -> int | None:
        slot = 4 + 2 * number
        if slot + 2 > self._vtable_size:
            return None
        offset = self.buffer.read("H", self._vtable + slot)
        return self.position + offset if offset else None

    def scalar(self, number: int, fmt: str, default: int = 0) -> int:
        """The scalar field, or its schema default when absent."""
        position = self._field(number)
        return default if position is None else self.buffer.read(fmt, position)

    def table(self, number: int) -> "Table | None":
        """The sub-table (or union value) behind the field."""
        position = self._field(number)
        return None if position is None else Table(self.buffer, position + self.buffer.read("I", position))

    def _vector(self, number: int, item_size: int) -> tuple[int, int]:
        position = self._field(number)
        if position is None:
            return 0, 0
        start = position + self.buffer.read("I", position)
        length = self.buffer.read("I", start)
        if start + 4 + length * item_size > len(self.buffer.data):
            raise ModelFileError(f"{self.buffer.name}: broken FlatBuffer, {length} items run past the end.")
        return start + 4, length

    def array(self, number: int, dtype: str) -> np.ndarray:
        """The vector of scalars as a read-only array (empty when absent)."""
        kind = np.dtype(dtype).newbyteorder("<")
        start, length = self._vector(number, kind.itemsize)
        return np.frombuffer(self.buffer.data, kind, length, start)

    def raw(self, number: int) -> bytes:
        """The vector of bytes (also a string) behind the field."""
        start, length = self._vector(number, 1)
        return self.buffer.data[start : start + length]

    def tables(self, number: int) -> list["Table"]:
        """The vector of sub-tables behind the field."""
        start, length = self._vector(number, 4)
        slots = range(start, start + 4 * length, 4)
        return [Table(self.buffer, slot + self.buffer.read("I", slot)) for slot in slots]
