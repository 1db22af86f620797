# SPDX-License-Identifier: Apache-2.0
"""Conversion of what comes in from outside to arrays of the expected shape; every message names the
field.

`validation` checks their values with compiled kernels. This file needs no numba, which takes long
to load: bodies are described and command lines read without it.
"""

from __future__ import annotations

from types import EllipsisType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .errors import ShapeError
from .part import Array

_Shape = tuple[int | EllipsisType | None, ...]
_FLOAT64 = np.dtype(np.float64)


def as_array(value: ArrayLike, shape: tuple[int | None, ...], name: str) -> Array:
    """Return `value` as contiguous float64 that can be written to.

    :param value: an array, or lists of numbers, of `shape`; what numpy's masked arrays mask becomes
        NaN.
    :param shape: the expected one, for instance (None, 3) for (n, 3): None is any length.
    :param name: what the array is, as a message begins.
    :raises ShapeError: it has another shape, or is not an array of numbers.
    """
    array = _writable(np.ascontiguousarray(_numbers(value, shape, name)))
    if array.shape == shape and array.ndim:
        return array
    if len(shape) != np.ndim(value) or any(
        n is not None and n != m for n, m in zip(shape, array.shape, strict=True)
    ):
        raise ShapeError(
            f"{name} must have shape {_written(shape)}, but got shape {np.shape(value)}."
        )
    return array


def as_arrays(value: ArrayLike, shape: tuple[int, ...], name: str) -> Array:
    """Return `value` as float64 of shape (..., *shape), whatever its leading dimensions.

    :param value: (...) numbers, whose last dimensions are ``shape``.
    :raises ShapeError: it has another shape, or is not an array of numbers.
    """
    array = _numbers(value, (..., *shape), name)
    if array.shape[-len(shape) :] != shape:
        raise ShapeError(
            f"{name} must have shape {_written((..., *shape))}, but got shape {array.shape}."
        )
    return array


def as_numbers(value: ArrayLike, name: str) -> Array:
    """Return `value` as float64 of its own shape; what numpy's masked arrays mask becomes NaN.

    :raises ShapeError: it is not an array of numbers.
    """
    return _numbers(value, (...,), name)


def as_integers(value: ArrayLike, name: str) -> Array:
    """Return `value` as contiguous int64 (n,) that can be written to.

    :raises ShapeError: it is not a list of whole numbers, or is a masked array that masks one.
    """
    if type(value) is not np.ndarray or value.dtype.kind not in "iu":
        _refuse_unless_numbers(value, "iu", "integers", (None,), name)
    if isinstance(value, np.ma.MaskedArray) and _masked(value).any():
        raise ShapeError(f"{name} must not be masked, but some are; leave these rows out.")
    array = np.asarray(value)
    if array.ndim != 1:
        raise ShapeError(
            f"{name} must be integers of shape (n,), but got {array.dtype} of shape {array.shape}."
        )
    return _writable(np.ascontiguousarray(array, dtype=np.int64))


def as_table(value: Any, ints: int, floats: int, name: str) -> tuple[Array, Array]:
    """Return the rows of a residual as int64 (n, ints) and float64 (n, floats).

    :raises ShapeError: it is not a pair of such arrays.
    """
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise ShapeError(
            f"Tables of {name!r} must be a pair of arrays (ints, floats), but got "
            f"{described(value)}."
        )
    what = "integers, as of body.point(name) or body.joint_names.index(name),"
    _refuse_unless_numbers(value[0], "iu", what, (None, ints), f"Whole numbers of {name!r}")
    _refuse_unless_numbers(value[1], "fiub", "numbers", (None, floats), f"Numbers of {name!r}")
    table = np.asarray(value[0], dtype=np.int64), np.asarray(value[1], dtype=np.float64)
    if (table[0].shape[1:], table[1].shape[1:]) != ((ints,), (floats,)) or len(table[0]) != len(
        table[1]
    ):
        raise ShapeError(
            f"Tables of {name!r} must have shapes (n, {ints}) and (n, {floats}), "
            f"but got {table[0].shape} and {table[1].shape}."
        )
    return table


def has_axis(value: ArrayLike, more_than: int = 0) -> bool:
    """Whether a value has more axes than that; a ragged list has, and is refused where it is
    converted.
    """
    try:
        return np.ndim(value) > more_than
    except ValueError:
        return True


def described(value: Any) -> str:
    """Return the words for a value of the wrong kind in a message."""
    if value is None:
        return "None"
    if isinstance(value, str):
        return f"the text {value[:40]!r}"
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype} of shape {value.shape}"
    kind = type(value).__name__
    return f"{'an' if kind[0] in 'aeioAEIO' else 'a'} {kind}"


def _writable(array: Array) -> Array:
    """Return the array, or a copy of one that is read-only: numba would compile every kernel anew
    that it is given to.
    """
    return array if array.flags.writeable else array.copy()


def _masked(value: np.ma.MaskedArray[Any, Any]) -> Array:
    mask: Array = np.ma.getmaskarray(value)  # type: ignore[no-untyped-call]
    return mask


def _numbers(value: ArrayLike, shape: _Shape, name: str) -> Array:
    """Return `value` as float64 of any shape; `shape` is for the message."""
    if type(value) is not np.ndarray or value.dtype is not _FLOAT64:
        _refuse_unless_numbers(value, "fiub", "numbers", shape, name)
        # whose masked values numpy's conversion would take for measured ones
        if isinstance(value, np.ma.MaskedArray):
            value = np.where(_masked(value), np.nan, value.data)
    return np.asarray(value, dtype=np.float64)


def _refuse_unless_numbers(value: Any, kinds: str, what: str, shape: _Shape, name: str) -> None:
    """Raise ShapeError for strings, None, ragged lists and numbers of another type; an empty list
    is of any type.
    """
    try:
        array = np.asarray(value)
        if array.dtype.kind in kinds or (array.size == 0 and array.dtype.kind == "f"):
            return
        found = (
            f"{array.dtype} of shape {array.shape}"
            if array.dtype.kind in "fiubc"
            else described(value)
        )
    except ValueError:  # numpy's, for lists of different lengths
        found = "a ragged list"
    raise ShapeError(f"{name} must be {what} of shape {_written(shape)}, but got {found}.")


def _written(shape: _Shape) -> str:
    """Return a shape as numpy writes it, with n for any length and ... for any leading
    dimensions.
    """
    lengths = ["n" if n is None else "..." if n is ... else str(n) for n in shape]
    return f"({', '.join(lengths)}{',' if len(shape) == 1 else ''})"
