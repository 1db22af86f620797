# SPDX-License-Identifier: GPL-3.0-or-later
"""Inert stand-ins for what a body pickle names, and the arrays that they stand for.

Each allowed global has one stand-in below; the classes and functions that a file names are never
imported. Neither scipy nor chumpy is needed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any, NoReturn, TypeGuard

import numpy as np
from numpy.typing import NDArray

from ..errors import ModelFileError

# elements of one sparse matrix made dense; SMPL-X's joint regressor has 0.6 million
LARGEST_DENSE = 5_000_000
DEEPEST = 8  # matrices and chumpy expressions within each other; real files have two

_DTYPE = re.compile(r"([<>|=]?)(\?|[biufSU][1-9][0-9]{0,3})")


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
    """``numpy.dtype(text)`` for plain numbers and text; structures and Python objects are
    refused.
    """

    def __init__(self, text: object, *_: object) -> None:
        """Parse a type as numpy writes it, for instance "<f8".

        :raises ModelFileError: it is none of plain numbers or text.
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
    file.
    """

    array: NDArray[Any] | None = None

    def __setstate__(self, state: object) -> None:
        """State as numpy writes it: (version,) shape, dtype, is_fortran, bytes."""
        if not isinstance(state, tuple) or len(state) not in (4, 5):
            raise ModelFileError("it holds a numpy array in an unknown form")
        shape, dtype, is_fortran, raw = state[-4:]
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
    made: PickledObject = kind()
    return made


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


def stand_in(dotted: str) -> Any:
    """Return the stand-in of an allowed global, given by module and name; None for any other."""
    return next(
        (found for pattern, found in _GLOBALS.items() if re.fullmatch(pattern, dotted)), None
    )


def _from_bytes(raw: object, dtype: object, shape: object, is_fortran: bool) -> NDArray[Any]:
    """Return a read-only array over ``raw``; the byte count must agree with the shape exactly."""
    if not isinstance(dtype, PickledDtype):
        raise ModelFileError("it holds a numpy array without a type")
    if not isinstance(raw, bytes):
        raise ModelFileError("it holds an array of Python objects; only numbers and text are read")
    if not _is_shape(shape):
        raise ModelFileError("it holds a numpy array with an impossible shape")
    expected = math.prod(shape) * dtype.dtype.itemsize
    if expected != len(raw):
        raise ModelFileError(
            f"it holds an array of {len(raw)} bytes whose shape {shape} needs {expected}"
        )
    if not raw:
        return np.zeros(shape, dtype.dtype)
    return np.frombuffer(raw, dtype.dtype).reshape(shape, order="F" if is_fortran else "C")


def _is_shape(shape: object) -> TypeGuard[tuple[int, ...]]:
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
    if not _is_shape(shape) or math.prod(shape) != index.size:
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
    if not _is_shape(shape) or max(shape) > LARGEST_DENSE or rows * columns > LARGEST_DENSE:
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
