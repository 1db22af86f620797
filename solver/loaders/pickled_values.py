# SPDX-License-Identifier: GPL-3.0-or-later
"""The values that a body pickle may hold, rebuilt by our own code: the classes that the file names are never called.

A pickle names its classes and says how to call them. Here each name on a short list stands for a ``Role``, and each
role has one inert construction below. Anything else is refused by name. Neither scipy nor chumpy is needed.
"""

from __future__ import annotations

import math
import re
from enum import Enum, auto
from typing import Any, TypeGuard

import numpy as np

from ..errors import ModelFileError

LARGEST_DENSE = 5_000_000  # elements of one sparse matrix made dense; SMPL-X's joint regressor has 0.6 million
DEEPEST_CHUMPY = 8  # nested chumpy expressions; real files have two

_DTYPE = re.compile(r"([<>|=]?)(\?|[biufSU][1-9][0-9]{0,3})")


class Role(Enum):
    """What an allowed global does in a body pickle."""

    RECONSTRUCT = auto()
    NDARRAY = auto()
    DTYPE = auto()
    SCALAR = auto()
    FROM_BUFFER = auto()
    ENCODE = auto()
    RECONSTRUCTOR = auto()
    OBJECT = auto()
    SET = auto()
    BYTES = auto()
    CSC = auto()
    CSR = auto()
    COO = auto()
    CHUMPY = auto()
    CHUMPY_SELECT = auto()


SPARSE = {Role.CSC, Role.CSR, Role.COO}
CLASSES = SPARSE | {Role.CHUMPY, Role.CHUMPY_SELECT}


def _allowed_globals() -> dict[tuple[str, str], Role]:
    table = {
        ("numpy", "ndarray"): Role.NDARRAY,
        ("numpy", "dtype"): Role.DTYPE,
        ("_codecs", "encode"): Role.ENCODE,
        ("chumpy", "Ch"): Role.CHUMPY,
        ("chumpy.ch", "Ch"): Role.CHUMPY,
        ("chumpy.reordering", "Select"): Role.CHUMPY_SELECT,
    }
    for core in ("numpy.core", "numpy._core"):  # renamed in numpy 2
        table[f"{core}.multiarray", "_reconstruct"] = Role.RECONSTRUCT
        table[f"{core}.multiarray", "scalar"] = Role.SCALAR
        table[f"{core}.numeric", "_frombuffer"] = Role.FROM_BUFFER
    for python2, python3 in (("__builtin__", "builtins"), ("copy_reg", "copyreg")):
        for module in (python2, python3):
            if python3 == "builtins":
                table |= {(module, "set"): Role.SET, (module, "frozenset"): Role.SET, (module, "object"): Role.OBJECT}
                table |= {(module, "bytes"): Role.BYTES, (module, "bytearray"): Role.BYTES}
            else:
                table[module, "_reconstructor"] = Role.RECONSTRUCTOR
    for role in SPARSE:
        kind = role.name.lower()
        for module in ("scipy.sparse", f"scipy.sparse.{kind}", f"scipy.sparse._{kind}"):
            table[module, f"{kind}_matrix"] = role
            table[module, f"{kind}_array"] = role
    return table


ALLOWED_GLOBALS = _allowed_globals()


def resolve_global(module: object, name: object) -> Role:
    """The role of an allowed global; anything else is refused by name, without importing it."""
    named = isinstance(module, str) and isinstance(name, str)
    role = ALLOWED_GLOBALS.get((module, name)) if named else None  # type: ignore[arg-type]
    if role is None:
        shown = f"{module:.80}.{name:.80}" if named else "an unnamed global"
        raise ModelFileError(f"it asks for {shown}, which a body file has no use for and which may be an attack")
    return role


class Opaque:
    """A set or another part of a chumpy array that nobody needs: its content is dropped."""


class PickledDtype:
    """``numpy.dtype(text)`` for plain numbers and text; structures and Python objects are refused."""

    def __init__(self, text: object):
        text = text.decode("latin1") if isinstance(text, bytes) else text
        if not isinstance(text, str) or _DTYPE.fullmatch(text) is None:
            shown = repr(text[:40]) if isinstance(text, str) else type(text).__name__
            raise ModelFileError(f"it holds an array of type {shown}; only numbers and text are read")
        self.dtype = np.dtype(text)

    def build(self, state: object) -> None:
        """State as numpy writes it: version, byte order, sub-array, field names, fields, …"""
        if not isinstance(state, tuple) or len(state) < 5 or any(part is not None for part in state[2:5]):
            raise ModelFileError("it holds a structured array type; only numbers and text are read")
        order = state[1].decode("latin1") if isinstance(state[1], bytes) else state[1]
        if order not in ("<", ">", "|", "="):
            raise ModelFileError("it holds an array type of unknown byte order")
        self.dtype = self.dtype.newbyteorder(order)  # type: ignore[arg-type]


class PickledArray:
    """A numpy array whose bytes lie in the file itself, so that it can never be larger than the file."""

    def __init__(self) -> None:
        self.array: np.ndarray | None = None

    def build(self, state: object) -> None:
        """State as numpy writes it: (version,) shape, dtype, is_fortran, bytes."""
        if not isinstance(state, tuple) or len(state) not in (4, 5):
            raise ModelFileError("it holds a numpy array in an unknown form")
        self.array = array_from_bytes(state[-1], state[-3], state[-4], "F" if state[-2] else "C")


def array_from_bytes(raw: object, dtype: object, shape: object, order: object) -> np.ndarray:
    """A read-only array over ``raw``; the byte count must agree with the shape exactly."""
    if not isinstance(dtype, PickledDtype):
        raise ModelFileError("it holds a numpy array without a type")
    if not isinstance(raw, bytes):
        raise ModelFileError("it holds an array of Python objects; only numbers and text are read")
    if not _is_shape(shape):
        raise ModelFileError("it holds a numpy array with an impossible shape")
    expected = math.prod(shape) * dtype.dtype.itemsize
    if expected != len(raw):
        raise ModelFileError(f"it holds an array of {len(raw)} bytes whose shape {shape} needs {expected}")
    if not raw:
        return np.zeros(shape, dtype.dtype)
    return np.frombuffer(raw, dtype.dtype).reshape(shape, order="F" if order in ("F", b"F") else "C")


def _is_shape(shape: object) -> TypeGuard[tuple[int, ...]]:
    return isinstance(shape, tuple) and len(shape) <= 32 and all(type(n) is int and n >= 0 for n in shape)


class PickledObject:
    """A scipy sparse matrix or a chumpy array: its attribute table, and nothing that could run."""

    def __init__(self, role: Role):
        self.role = role
        self.state: dict[str, Any] = {}

    def build(self, state: object) -> None:
        """State: the attribute table, or that and a table of slots."""
        if isinstance(state, tuple) and len(state) == 2:
            state = state[0]
        if not isinstance(state, dict):
            raise ModelFileError(f"it holds a {self.role.name.lower()} object in an unknown form")
        self.state = state


def to_array(value: object, depth: int = 0) -> np.ndarray:
    """The numpy array that an unpickled value stands for; sparse matrices become dense.

    :raises ModelFileError: not an array, unfinished, too large or inconsistent.
    """
    if isinstance(value, np.ndarray | np.generic):
        return np.asarray(value)
    if isinstance(value, PickledArray) and value.array is not None:
        return value.array
    if isinstance(value, bytes | str):
        return np.array(value.decode("latin1") if isinstance(value, bytes) else value)
    if isinstance(value, PickledObject) and depth < DEEPEST_CHUMPY:
        if value.role in SPARSE:
            return _dense(value.role, value.state)
        if value.role is Role.CHUMPY:
            return to_array(value.state.get("x"), depth + 1)
        return _selected(value.state, depth + 1)
    found = "an unfinished array" if isinstance(value, PickledArray) else f"a {type(value).__name__}"
    raise ModelFileError(f"an array was expected, but {found} was found")


def _selected(state: dict[str, Any], depth: int) -> np.ndarray:
    """chumpy's slice of an array: a.ravel()[idxs], reshaped."""
    flat = to_array(state.get("a"), depth).ravel()
    if flat.dtype.kind not in "biuf":
        raise ModelFileError("it holds a chumpy slice without numbers")
    index = _indices(to_array(state.get("idxs"), depth).ravel(), flat.size)
    shape = state.get("preferred_shape")
    if shape is None:
        return flat[index]
    if not _is_shape(shape) or math.prod(shape) != index.size:
        raise ModelFileError("it holds a chumpy slice with an impossible shape")
    return flat[index].reshape(shape)


def _indices(index: np.ndarray, size: int) -> np.ndarray:
    if index.dtype.kind not in "iu" or index.ndim != 1 or (index.size and (index.min() < 0 or index.max() >= size)):
        raise ModelFileError(f"it holds indices outside 0..{size - 1}")
    return index.astype(np.intp)


def _dense(role: Role, state: dict[str, Any]) -> np.ndarray:
    """A CSC, CSR or COO matrix (row, column) made dense; repeated entries add up."""
    shape = state.get("_shape", state.get("shape"))
    if not isinstance(shape, tuple) or len(shape) != 2:
        raise ModelFileError("it holds a sparse matrix without a shape")
    rows, columns = (to_int(n) for n in shape)
    if rows < 0 or columns < 0 or rows * columns > LARGEST_DENSE or max(rows, columns) > LARGEST_DENSE:
        raise ModelFileError(f"it holds a sparse matrix of shape ({rows}, {columns}), too large for a body")
    data = to_array(state.get("data"))
    if data.ndim != 1 or data.dtype.kind not in "biuf":
        raise ModelFileError("it holds a sparse matrix without numbers")
    if role is Role.COO:
        pair = state.get("coords", (state.get("row"), state.get("col")))
        if not isinstance(pair, tuple) or len(pair) != 2:
            raise ModelFileError("it holds a COO matrix without coordinates")
        i, j = _indices(to_array(pair[0]), rows), _indices(to_array(pair[1]), columns)
    else:
        major, minor = (columns, rows) if role is Role.CSC else (rows, columns)
        start = to_array(state.get("indptr"))
        if start.shape != (major + 1,) or start.dtype.kind not in "iu":
            raise ModelFileError("it holds a sparse matrix with a broken index")
        start = start.astype(np.int64)
        count = np.diff(start)
        if start[0] != 0 or (count < 0).any() or start[-1] > data.size:
            raise ModelFileError("it holds a sparse matrix with a broken index")
        data = data[: start[-1]]
        inner = _indices(to_array(state.get("indices"))[: start[-1]], minor)
        outer = np.repeat(np.arange(major), count)
        i, j = (inner, outer) if role is Role.CSC else (outer, inner)
    if not i.shape == j.shape == data.shape:
        raise ModelFileError("it holds a sparse matrix whose parts differ in length")
    dense = np.zeros((rows, columns))
    np.add.at(dense, (i, j), data)
    return dense


def to_int(value: object) -> int:
    """A Python int from an int or a numpy integer."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        return int(value)
    raise ModelFileError(f"a whole number was expected, but a {type(value).__name__} was found")
