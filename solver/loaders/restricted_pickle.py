# SPDX-License-Identifier: GPL-3.0-or-later
"""Body pickles, protocols 0 to 5, Python 2 and 3, read by Python's own unpickler without running
what they name.

Globals become the inert stand-ins of ``pickled_values``; a name that is not listed there is
refused. The unpickler is the standard library's in pure Python: the one in C allocates memory for
any memo index that a file asks for, and hashes tuples that a file uses as keys, which can take
arbitrarily long. Python 2 strings stay bytes, so that array data is unchanged.

Bounds: the file's size, the number of opcodes, and recoded text, which may not exceed the file's
size; every array is a view of bytes in the file. So memory stays within a small multiple of the
file. Nothing here recurses.
"""

from __future__ import annotations

import io
import pickle
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import ModelFileError
from .pickled_values import Discarded, Global, stand_in
from .regular_file import in_one_line

LARGEST_FILE = 1 << 30  # bytes; the largest official SMPL-X pickle has half of it
MAX_OPCODES = 200_000  # official files need a few thousand

_UNREADABLE: tuple[type[Exception], ...] = (
    pickle.UnpicklingError,
    EOFError,
    AttributeError,
    ValueError,
    TypeError,
)
_UNREADABLE += (LookupError, OverflowError, struct.error, MemoryError)
_REFUSED = {
    pickle.PERSID,
    pickle.BINPERSID,
    pickle.EXT1,
    pickle.EXT2,
    pickle.EXT4,
    pickle.OBJ,
    pickle.NEWOBJ_EX,
}
_REFUSED |= {pickle.NEXT_BUFFER, pickle.READONLY_BUFFER}


def read_pickle(path: Path, what: str = "a body") -> dict[str, Any]:
    """Return the dictionary at the top of a body pickle, e.g. of an SMPL .pkl file; values as in
    ``pickled_values``.

    :param what: what the file should hold, for messages.
    :raises ModelFileError: unreadable, too large, damaged, or asks for anything but arrays; nothing
        has run then.
    """
    try:
        with path.open("rb") as file:  # read() sets aside as much as it is asked for
            data = file.read(min(path.stat().st_size, LARGEST_FILE) + 1)
    except OSError as cause:
        raise ModelFileError(
            f"{path} cannot be read ({cause.strerror}); choose another file"
        ) from cause
    if len(data) > LARGEST_FILE:
        raise ModelFileError(
            f"{path} is larger than {LARGEST_FILE >> 20} MiB, too large for {what}"
        )
    try:
        result = _BodyUnpickler(data).load()
    except ModelFileError as cause:
        raise ModelFileError(
            f"{path} cannot be used as {what}: {cause}; get it from its publisher again"
        ) from None
    except _UNREADABLE as cause:
        raise ModelFileError(
            f"{path} is not a readable pickle ({in_one_line(cause)}); download it again"
        ) from cause
    if not isinstance(result, dict):
        raise ModelFileError(
            f"{path} contains a {type(result).__name__}, not a table of arrays; choose another file"
        )
    return result


class _BodyUnpickler(pickle._Unpickler):
    """Keeps tables to plain keys, drops sets, and counts what it does."""

    stack: list[Any]
    append: Callable[[Any], None]
    read: Callable[[int], bytes]
    pop_mark: Callable[[], list[Any]]

    def __init__(self, data: bytes) -> None:
        super().__init__(io.BytesIO(data), encoding="bytes")
        self.dispatch = _Handlers(_HANDLERS)  # type: ignore[misc,assignment]
        self._recodable = len(data)

    def find_class(self, module: str, name: str) -> Any:
        """Return the stand-in of an allowed global; refuse anything else by name, without importing
        it.

        :raises ModelFileError: the name is not allowed.
        """
        if (module, name) == ("_codecs", "encode"):
            return Global(self._encode)
        if module in ("builtins", "__builtin__") and name in ("bytes", "bytearray"):
            return Global(
                lambda *given: self._encode(*given) if len(given) == 2 else b"".join(given)
            )
        found = stand_in(f"{module}.{name}")
        if found is None:
            shown = f"{module:.80}.{name:.80}"
            raise ModelFileError(
                f"it asks for {shown}, which such a file has no use for and which may be an attack"
            )
        return found

    def _encode(self, text: str, codec: str | bytes) -> bytes:
        """Return bytes that Python 3 wrote as text for old protocols; each at most once, so that
        the sum is bounded.
        """
        if not isinstance(text, str) or codec not in ("latin1", "latin-1", b"latin1"):
            raise ModelFileError("it recodes text in a way that such files do not")
        self._recodable -= len(text)
        if self._recodable < 0:
            raise ModelFileError("it repeats its data more often than such a file does")
        return text.encode("latin1")

    def set_items(self, items: list[Any]) -> None:
        """Add alternating keys and values to the table on top; Python 2 string keys become text.

        :raises ModelFileError: there is no table on top, a value is missing, or a key is no plain
            value.
        """
        table = self.stack[-1]
        if type(table) is not dict or len(items) % 2:
            raise ModelFileError("it adds keys to something that is not a table, or without values")
        keys = [key.decode("latin1") if isinstance(key, bytes) else key for key in items[::2]]
        if any(type(key) not in (str, int, float, bool, type(None)) for key in keys):
            raise ModelFileError("it holds a table whose keys are not plain values")
        table.update(zip(keys, items[1::2], strict=True))

    def load_setitem(self) -> None:
        """Handle SETITEM."""
        value = self.stack.pop()
        key = self.stack.pop()
        self.set_items([key, value])

    def load_dict(self) -> None:
        """Handle DICT."""
        items = self.pop_mark()
        self.append({})
        self.set_items(items)

    def load_bytearray8(self) -> None:
        """Handle BYTEARRAY8; Python's own allocates before it reads."""
        self.append(self.read(struct.unpack("<Q", self.read(8))[0]))

    def load_frozenset(self) -> None:
        """Handle FROZENSET."""
        self.pop_mark()
        self.append(Discarded())


class _Handlers(dict[int, Callable[[Any], object]]):
    """What to do at each opcode; asking counts, because the unpickler asks once for each."""

    _count = 0

    def __getitem__(self, opcode: int) -> Callable[[Any], object]:
        self._count += 1
        if self._count > MAX_OPCODES:
            raise ModelFileError(
                f"it has more than {MAX_OPCODES} pickle instructions, too many for such a file"
            )
        return super().__getitem__(opcode)

    def __missing__(self, opcode: int) -> Callable[[Any], object]:
        raise ModelFileError(
            f"it uses the pickle instruction {bytes([opcode])!r}, which such a file has no use for"
        )


_HANDLERS: dict[int, Callable[[Any], object]] = {
    **{
        code: handler
        for code, handler in pickle._Unpickler.dispatch.items()
        if bytes([code]) not in _REFUSED
    },
    # a frame is read opcode by opcode, like the rest
    pickle.FRAME[0]: lambda unpickler: unpickler.read(8),
    pickle.BYTEARRAY8[0]: _BodyUnpickler.load_bytearray8,
    pickle.EMPTY_SET[0]: lambda unpickler: unpickler.append(Discarded()),
    pickle.FROZENSET[0]: _BodyUnpickler.load_frozenset,
    pickle.DICT[0]: _BodyUnpickler.load_dict,
    pickle.SETITEM[0]: _BodyUnpickler.load_setitem,
    pickle.SETITEMS[0]: lambda unpickler: unpickler.set_items(unpickler.pop_mark()),
}
