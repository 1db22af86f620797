# SPDX-License-Identifier: GPL-3.0-or-later
"""Body pickles, protocols 0 to 5, Python 2 and 3, read by Python's own unpickler without running
what they name.

Each allowed global has an inert stand-in below; the classes and functions that a file names are
never imported, and a name that is not listed is refused. Neither scipy nor chumpy is needed. The
unpickler is the standard library's in pure Python: the one in C allocates memory for any memo index
that a file asks for, and hashes tuples that a file uses as keys, which can take arbitrarily long.
Python 2 strings stay bytes, so that array data is unchanged.

Bounds: the file's size, the number of opcodes, and recoded text, which may not exceed the file's
size; every array is a view of bytes in the file. So memory stays within a small multiple of the
file. Nothing here recurses.
"""

from __future__ import annotations

import io
import math
import pickle
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, TypeGuard

import numpy as np
from numpy.typing import NDArray

from ...solver.errors import ModelFileError
from .files import UNREADABLE, in_one_line

# elements of one sparse matrix made dense; SMPL-X's joint regressor has 0.6 million
LARGEST_DENSE = 5_000_000
DEEPEST = 8  # matrices and chumpy expressions within each other; real files have two

_DTYPE = re.compile(r"([<>|=]?)(\?|O8?|[biufSU][1-9][0-9]{0,3})")


class Global:
    """A function that a pickle may call, and what happens then; nothing a pickle does changes
    it.
    """

    __slots__ = ("_make",)

    def __init__(self, make: Callable[..., Any]) -> None:
        self._make = make

    def __call__(self, *arguments: Any) -> Any:
        """Return the stand-in of what the call would return."""
        return self._make(*arguments)

    def __setstate__(self, state: object) -> None:
        raise ModelFileError("it sets attributes of a function")


class Discarded:
    """A set; its content is not needed and is dropped."""

    __slots__ = ()

    def add(self, item: object) -> None:
        """Drop an item."""


class PickledDtype:
    """``numpy.dtype(text)`` for plain numbers, text and Python objects; structures are refused."""

    def __init__(self, text: object, *_: object) -> None:
        """Parse a type as numpy writes it, for instance "<f8".

        :raises ModelFileError: it is none of these.
        """
        text = text.decode("latin1") if isinstance(text, bytes) else text
        if not isinstance(text, str) or _DTYPE.fullmatch(text) is None:
            shown = repr(text[:40]) if isinstance(text, str) else type(text).__name__
            raise ModelFileError(
                f"it holds an array of type {shown}; only numbers and text are read"
            )
        self.dtype = np.dtype(text)

    def __setstate__(self, state: object) -> None:
        """State as numpy writes it: version, byte order, sub-array, field names, fields, …"""
        if (
            not isinstance(state, tuple)
            or len(state) < 5
            or any(part is not None for part in state[2:5])
        ):
            raise ModelFileError("it holds a structured array type; only numbers and text are read")
        order = state[1].decode("latin1") if isinstance(state[1], bytes) else state[1]
        if order not in ("<", ">", "|", "="):
            raise ModelFileError("it holds an array type of unknown byte order")
        self.dtype = self.dtype.newbyteorder(order)  # type: ignore[arg-type]


class PickledArray:
    """A numpy array whose bytes lie in the file itself, so that it can never be larger than the
    file; or (``items``) one of Python objects.
    """

    array: NDArray[Any] | None = None
    items: list[Any] | None = None

    def __setstate__(self, state: object) -> None:
        """State as numpy writes it: (version,) shape, dtype, is_fortran, bytes."""
        if not isinstance(state, tuple) or len(state) not in (4, 5):
            raise ModelFileError("it holds a numpy array in an unknown form")
        shape, dtype, is_fortran, raw = state[-4:]
        if isinstance(dtype, PickledDtype) and dtype.dtype.hasobject:
            if not isinstance(raw, list):
                raise ModelFileError("it holds an array of objects in an unknown form")
            self.items = raw
            return
        self.array = _from_bytes(raw, dtype, shape, bool(is_fortran))


class PickledObject:
    """A scipy sparse matrix or a chumpy array: its attribute table, and nothing that could run."""

    state: dict[str, Any] | None = None

    def __setstate__(self, state: object) -> None:
        """State: the attribute table, or that and a table of slots."""
        state = state[0] if isinstance(state, tuple) and len(state) == 2 else state
        if not isinstance(state, dict):
            raise ModelFileError(f"it holds a {type(self).__name__} object in an unknown form")
        self.state = state


_SPARSE = ("csc", "csr", "coo")
_CLASSES = {name: type(name, (PickledObject,), {}) for name in (*_SPARSE, "Ch", "Select")}


def _refuse(*_: object) -> NoReturn:
    raise ModelFileError("it makes an object in a way that such files do not")


_NDARRAY = Global(_refuse)
_OBJECT = Global(_refuse)


def _reconstruct(kind: object, *_: object) -> PickledArray:
    if kind is not _NDARRAY:
        _refuse()
    return PickledArray()


def _reconstructor(kind: Any, base: object, state: object) -> PickledObject:
    if kind not in _CLASSES.values() or base is not _OBJECT or state is not None:
        _refuse()
    return kind()


def _from_buffer(raw: object, dtype: object, shape: object, order: object) -> PickledArray:
    made = PickledArray()
    made.__setstate__((shape, dtype, order in ("F", b"F"), raw))
    return made


def _scalar(dtype: object, raw: object) -> Any:
    return _from_bytes(raw, dtype, (), False)[()]


# Modules have had several names: Python 2 and 3, numpy 1 and 2, scipy before and after 1.8.
_GLOBALS: dict[str, Any] = {
    r"numpy\.ndarray": _NDARRAY,
    r"numpy\.dtype": PickledDtype,
    r"numpy\._?core\.multiarray\._reconstruct": Global(_reconstruct),
    r"numpy\._?core\.multiarray\.scalar": Global(_scalar),
    r"numpy\._?core\.numeric\._frombuffer": Global(_from_buffer),
    r"(builtins|__builtin__)\.object": _OBJECT,
    r"(builtins|__builtin__)\.(frozen)?set": Global(lambda *_: Discarded()),
    r"copy_?reg\._reconstructor": Global(_reconstructor),
    r"chumpy(\.ch)?\.Ch": _CLASSES["Ch"],
    r"chumpy\.reordering\.Select": _CLASSES["Select"],
    **{rf"scipy\.sparse(\._?{kind})?\.{kind}_(matrix|array)": _CLASSES[kind] for kind in _SPARSE},
}


def _from_bytes(raw: object, dtype: object, shape: object, is_fortran: bool) -> NDArray[Any]:
    """Return a read-only array over ``raw``; the byte count must agree with the shape exactly."""
    if not isinstance(dtype, PickledDtype) or dtype.dtype.hasobject:
        raise ModelFileError("it holds a numpy array without a type of numbers or text")
    if not isinstance(raw, bytes):
        raise ModelFileError("it holds an array of Python objects; only numbers and text are read")
    if not is_shape(shape):
        raise ModelFileError("it holds a numpy array with an impossible shape")
    expected = math.prod(shape) * dtype.dtype.itemsize
    if expected != len(raw):
        raise ModelFileError(
            f"it holds an array of {len(raw)} bytes whose shape {shape} needs {expected}"
        )
    if not raw:
        return np.zeros(shape, dtype.dtype)
    return np.frombuffer(raw, dtype.dtype).reshape(shape, order="F" if is_fortran else "C")


def is_shape(shape: object) -> TypeGuard[tuple[int, ...]]:
    """Return whether a value is the shape of an array: numbers from 0."""
    return (
        isinstance(shape, tuple)
        and len(shape) <= 32
        and all(type(n) is int and 0 <= n < 1 << 63 for n in shape)
    )


def to_array(value: object, depth: int = 0) -> NDArray[Any]:
    """Return the numpy array that an unpickled value stands for; sparse matrices become dense.

    :raises ModelFileError: not an array, unfinished, too large or inconsistent.
    """
    if isinstance(value, np.generic):
        return np.asarray(value)
    if isinstance(value, PickledArray) and value.array is not None:
        return value.array
    if isinstance(value, bytes | str):
        return np.array(value.decode("latin1") if isinstance(value, bytes) else value)
    if isinstance(value, PickledObject) and value.state is not None and depth < DEEPEST:
        kind = type(value).__name__
        deeper = depth + 1
        if kind in _SPARSE:
            return _dense(kind, value.state, deeper)
        return (
            _selected(value.state, deeper)
            if kind == "Select"
            else to_array(value.state.get("x"), deeper)
        )
    if isinstance(value, PickledArray) and value.items is not None:
        raise ModelFileError("it holds an array of Python objects; only numbers and text are read")
    raise ModelFileError(
        f"an array was expected, but a {type(value).__name__} was found, or an unfinished array"
    )


def _selected(state: dict[str, Any], depth: int) -> NDArray[Any]:
    """Return the slice of an array as chumpy has it: a.ravel()[idxs], reshaped."""
    flat = to_array(state.get("a"), depth).ravel()
    if flat.dtype.kind not in "biuf":
        raise ModelFileError("it holds a chumpy slice without numbers")
    index = _indices(to_array(state.get("idxs"), depth).ravel(), flat.size)
    shape = state.get("preferred_shape") or index.shape
    if not is_shape(shape) or math.prod(shape) != index.size:
        raise ModelFileError("it holds a chumpy slice with an impossible shape")
    return flat[index].reshape(shape)


def _dense(kind: str, state: dict[str, Any], depth: int) -> NDArray[np.float64]:
    """Return a CSC, CSR or COO matrix (row, column) as a dense one; repeated entries add up."""
    shape = state.get("_shape", state.get("shape"))
    if (
        not isinstance(shape, tuple)
        or len(shape) != 2
        or not all(isinstance(n, int | np.integer) for n in shape)
    ):
        raise ModelFileError("it holds a sparse matrix without a shape")
    rows, columns = shape = tuple(int(n) for n in shape)
    if not is_shape(shape) or max(shape) > LARGEST_DENSE or rows * columns > LARGEST_DENSE:
        raise ModelFileError("it holds a sparse matrix of a negative size, or too large for a body")
    data = to_array(state.get("data"), depth)
    if data.ndim != 1 or data.dtype.kind not in "biuf":
        raise ModelFileError("it holds a sparse matrix without numbers")
    if kind == "coo":
        pair = state.get("coords", (state.get("row"), state.get("col")))
        if not isinstance(pair, tuple) or len(pair) != 2:
            raise ModelFileError("it holds a COO matrix without coordinates")
        i = _indices(to_array(pair[0], depth), rows)
        j = _indices(to_array(pair[1], depth), columns)
    else:
        major, minor = (columns, rows) if kind == "csc" else (rows, columns)
        start = to_array(state.get("indptr"), depth)
        if start.shape != (major + 1,) or start.dtype.kind not in "iu":
            raise ModelFileError("it holds a sparse matrix with a broken index")
        start = start.astype(np.int64)
        count = np.diff(start)
        if start[0] != 0 or (count < 0).any() or start[-1] > data.size:
            raise ModelFileError("it holds a sparse matrix with a broken index")
        data = data[: start[-1]]
        inner = _indices(to_array(state.get("indices"), depth)[: start[-1]], minor)
        outer = np.repeat(np.arange(major), count)
        i, j = (inner, outer) if kind == "csc" else (outer, inner)
    if not i.shape == j.shape == data.shape:
        raise ModelFileError("it holds a sparse matrix whose parts differ in length")
    dense = np.zeros((rows, columns))
    np.add.at(dense, (i, j), data)
    return dense


def _indices(index: NDArray[Any], size: int) -> NDArray[np.intp]:
    if (
        index.dtype.kind not in "iu"
        or index.ndim != 1
        or (index.size and (index.min() < 0 or index.max() >= size))
    ):
        raise ModelFileError(f"it holds indices outside 0..{size - 1}")
    return index.astype(np.intp)


LARGEST_FILE = 1 << 30  # bytes; the largest official SMPL-X pickle has half of it
MAX_OPCODES = 200_000  # official files need a few thousand

UNREADABLE_PICKLE: tuple[type[Exception], ...] = (
    *UNREADABLE,
    pickle.UnpicklingError,
    AttributeError,
)
_REFUSED = {
    pickle.PERSID,
    pickle.BINPERSID,
    pickle.EXT1,
    pickle.EXT2,
    pickle.EXT4,
    pickle.OBJ,
    pickle.NEWOBJ_EX,
    pickle.NEXT_BUFFER,
    pickle.READONLY_BUFFER,
}


def read_pickle(path: Path, what: str = "a body") -> dict[str, Any]:
    """Return the dictionary at the top of a body pickle, e.g. of an SMPL .pkl file; values as in
    ``to_array``.

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
    except UNREADABLE_PICKLE as cause:
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
        self.dispatch = _Handlers(HANDLERS)  # type: ignore[misc,assignment]
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
        for pattern, stand_in in _GLOBALS.items():
            if re.fullmatch(pattern, f"{module}.{name}"):
                return stand_in
        shown = in_one_line(f"{module:.80}.{name:.80}")
        raise ModelFileError(
            f"it asks for {shown}, which such a file has no use for and which may be an attack"
        )

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

    def __init__(
        self, handlers: dict[int, Callable[[Any], object]], most: int = MAX_OPCODES
    ) -> None:
        super().__init__(handlers)
        self._most = most

    def __getitem__(self, opcode: int) -> Callable[[Any], object]:
        self._count += 1
        if self._count > self._most:
            raise ModelFileError(
                f"it has more than {self._most} pickle instructions, too many for such a file"
            )
        return super().__getitem__(opcode)

    def __missing__(self, opcode: int) -> Callable[[Any], object]:
        raise ModelFileError(
            f"it uses the pickle instruction {bytes([opcode])!r}, which such a file has no use for"
        )


HANDLERS: dict[int, Callable[[Any], object]] = {
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
