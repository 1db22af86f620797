# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of arrays within tables, as trackers save their results: .npz and .npy with pickled
dictionaries, .pkl of pickle or joblib, and PyTorch's .pt.

They are read by the inert unpickler of `pickles`: nothing that a file names is imported or run.
Joblib's arrays and PyTorch's tensors have stand-ins here, which hold no more than the bytes in the
file.
"""

from __future__ import annotations

import io
import math
import pickle
import zipfile
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.errors import InputError, ModelFileError
from .files import (
    LARGEST_BYTES,
    check_regular,
    in_one_line,
    is_archive,
    read_header,
    read_npz,
)
from .pickles import (
    HANDLERS,
    UNREADABLE_PICKLE,
    Global,
    PickledArray,
    PickledDtype,
    _BodyUnpickler,
    _Handlers,
    is_shape,
    to_array,
)

Table = dict[str, Any]  # of arrays, and of further tables
DEEPEST = 12  # tables within each other; trackers' files have four
MAX_OPCODES = 5_000_000  # of a file with a table for each frame
_LARGEST_PICKLE = 1 << 30  # bytes, unpacked
_ZLIB = b"\x78"  # the first byte of what joblib has compressed
# How pickles begin: from protocol 2 on, and the tables, lists, tuples and objects of older ones.
_PICKLES = (b"\x80", b"}", b"]", b"(", b"c")
_PYTORCH = "data.pkl"
_STORAGES = {
    "DoubleStorage": "<f8",
    "FloatStorage": "<f4",
    "HalfStorage": "<f2",
    "LongStorage": "<i8",
    "IntStorage": "<i4",
    "ShortStorage": "<i2",
    "ByteStorage": "|u1",
    "BoolStorage": "|b1",
}


def read_tables(path: Path, error: type[InputError], what: str, wanted: Collection[str]) -> Table:
    """Return the tables of a file: arrays and further tables by name, numbered where the file has a
    list. Names with slashes in a .npz file become tables.

    :param error: class of what is raised.
    :param what: what the file should be, for messages.
    :param wanted: the plain arrays of a .npz file to read; of the others, only the shape is kept.
    :raises InputError: as ``error``, when the file cannot be read, is too large, or asks for
        anything but arrays.
    """
    check_regular(path, error, what, LARGEST_BYTES)
    try:
        if is_archive(path):
            with zipfile.ZipFile(path) as archive:
                tables = _of_archive(archive, path, error, what, wanted)
        elif _begins_like_tables(path):
            tables = _of_stream(path)
        else:
            raise error(
                f"{path} is not a readable {what} (it is no archive, array or pickle); choose "
                "another file"
            )
    except ModelFileError as cause:
        raise error(f"{path} cannot be used as a {what}: {cause}") from None
    except FileNotFoundError as cause:
        raise error(f"{path} does not exist; choose an existing {what}") from cause
    except UNREADABLE_PICKLE as cause:
        raise error(
            f"{path} is not a readable {what} ({in_one_line(cause)}); choose another file"
        ) from cause
    if not isinstance(tables, dict):
        raise error(f"{path} holds no table of arrays; choose another {what}")
    return tables


def _of_archive(
    archive: zipfile.ZipFile,
    path: Path,
    error: type[InputError],
    what: str,
    wanted: Collection[str],
) -> Any:
    names = archive.namelist()
    pickled = next((name for name in names if Path(name).name == _PYTORCH), None)
    if pickled is not None:
        return _of_pytorch(archive, pickled)
    tables: Table = {}
    plain = []
    for entry in archive.infolist():
        key = entry.filename.removesuffix(".npy")
        with archive.open(entry) as file:
            shape, _, dtype = read_header(file, key)
            if dtype.hasobject:
                if entry.file_size > _LARGEST_PICKLE:
                    raise ModelFileError(f"{key} is too large")
                _put(tables, key, _Plain().convert(_unpickled(file.read())))
            elif key.rsplit("/", 1)[-1] in wanted:
                plain.append(key)
            else:
                _put(tables, key, np.broadcast_to(np.zeros((), bool), shape))
    for key, array in read_npz(path, error, what, wanted=plain).items():
        _put(tables, key, array)
    return tables


def _put(tables: Table, key: str, value: Any) -> None:
    """Put a value into the table that its name says, "a/b" into the table a."""
    *outer, last = key.split("/")[:DEEPEST]
    for name in outer:
        inner = tables.setdefault(name, {})
        if not isinstance(inner, dict):
            raise ModelFileError(f"{name} is both an array and a table")
        tables = inner
    tables[last] = value


def _begins_like_tables(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(8).startswith((np.lib.format.MAGIC_PREFIX, _ZLIB, *_PICKLES))


def _of_stream(path: Path) -> Any:
    """Read a file that is no archive: an array of Python objects, or a pickle."""
    with path.open("rb") as file:
        data = file.read(_LARGEST_PICKLE + 1)
    if len(data) > _LARGEST_PICKLE:
        raise ModelFileError(f"it is larger than {_LARGEST_PICKLE >> 20} MiB")
    if data.startswith(np.lib.format.MAGIC_PREFIX):
        stream = io.BytesIO(data)
        _, _, dtype = read_header(stream, "its array")
        if not dtype.hasobject:
            raise ModelFileError("it holds a single array without a name")
        return _Plain().convert(_unpickled(stream.read()))
    if data.startswith(_ZLIB):
        unpacker = zlib.decompressobj()
        data = unpacker.decompress(data, _LARGEST_PICKLE)
        if unpacker.unconsumed_tail:
            raise ModelFileError(f"it unpacks to more than {_LARGEST_PICKLE >> 20} MiB")
    return _Plain().convert(_unpickled(data))


def _of_pytorch(archive: zipfile.ZipFile, pickled: str) -> Any:
    folder = pickled.removesuffix(_PYTORCH)
    if sum(entry.file_size for entry in archive.infolist()) > LARGEST_BYTES:
        raise ModelFileError("it unpacks to too much")
    if f"{folder}byteorder" in archive.namelist():
        if archive.read(f"{folder}byteorder") != b"little":
            raise ModelFileError("its tensors are big-endian")
    return _Plain().convert(
        _unpickled(archive.read(pickled), lambda key: archive.read(f"{folder}data/{key}"))
    )


def _unpickled(data: bytes, storage_bytes: Any = None) -> Any:
    return _TableUnpickler(data, storage_bytes).load()


class _JoblibArray(PickledArray):
    """joblib's NumpyArrayWrapper: the bytes of the array follow it in the file."""

    _state: dict[str, Any] | None = None

    def __setstate__(self, state: object) -> None:
        if not isinstance(state, dict):
            raise ModelFileError("it holds a joblib array in an unknown form")
        self._state = state

    def fill(self, read: Any) -> None:
        """Read the array's bytes, which come next."""
        state = self._state
        if state is None or self.array is not None:
            return
        dtype = state.get("dtype")
        shape = state.get("shape")
        if not isinstance(dtype, PickledDtype) or dtype.dtype.hasobject or not is_shape(shape):
            raise ModelFileError("it holds a joblib array that is not one of numbers or text")
        if state.get("numpy_array_alignment_bytes") is not None:
            read(read(1)[0])
        raw = read(math.prod(shape) * dtype.dtype.itemsize)
        super().__setstate__((shape, dtype, state.get("order") in ("F", b"F"), raw))


class _Storage:
    """The bytes of PyTorch's tensors, of which each is a part."""

    def __init__(self, array: NDArray[Any]) -> None:
        self.array = array


def _rebuild_tensor(
    storage: object, offset: object, shape: object, strides: object, *_: object
) -> PickledArray:
    """Return the array that a tensor is, as torch._utils._rebuild_tensor_v2 makes it."""
    if not isinstance(storage, _Storage) or not is_shape(shape) or not is_shape(strides):
        raise ModelFileError("it holds a tensor in an unknown form")
    if not isinstance(offset, int) or offset < 0 or len(shape) != len(strides):
        raise ModelFileError("it holds a tensor in an unknown form")
    made = PickledArray()
    count = math.prod(shape)
    last = offset + sum((n - 1) * step for n, step in zip(shape, strides, strict=True))
    if count == 0:
        made.array = np.zeros(shape, storage.array.dtype)
        return made
    if last >= storage.array.size or count > storage.array.size:
        raise ModelFileError("it holds a tensor that is larger than its data")
    size = storage.array.itemsize
    made.array = np.lib.stride_tricks.as_strided(
        storage.array[offset:], shape, [size * step for step in strides], writeable=False
    )
    return made


class _TableUnpickler(_BodyUnpickler):
    """Knows the stand-ins above as well.

    :param storage_bytes: returns the bytes of a tensor's storage, by its key; None: there are none.
    """

    def __init__(self, data: bytes, storage_bytes: Any) -> None:
        super().__init__(data)
        handlers = HANDLERS | {
            pickle.BUILD[0]: _TableUnpickler._build,
            pickle.BINPERSID[0]: _TableUnpickler._storage,
        }
        self.dispatch = _Handlers(handlers, MAX_OPCODES)  # type: ignore[misc,assignment]
        self._storage_bytes = storage_bytes
        self._storages: dict[str, _Storage] = {}

    def find_class(self, module: str, name: str) -> Any:
        """Return the stand-in of an allowed global.

        :raises ModelFileError: the name is not allowed.
        """
        if (module, name) == ("joblib.numpy_pickle", "NumpyArrayWrapper"):
            return _JoblibArray
        if (module, name) == ("collections", "OrderedDict"):
            return Global(lambda *_: {})
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return Global(_rebuild_tensor)
        if module == "torch" and name in _STORAGES:
            return name
        return super().find_class(module, name)

    def _build(self) -> None:
        HANDLERS[pickle.BUILD[0]](self)
        made = self.stack[-1]
        if isinstance(made, _JoblibArray):
            made.fill(self.read)

    def _storage(self) -> None:
        given = self.stack.pop()
        if (
            self._storage_bytes is None
            or not isinstance(given, tuple)
            or len(given) < 3
            or given[0] != "storage"
            or given[1] not in _STORAGES
            or not str(given[2]).isalnum()
        ):
            raise ModelFileError("it refers to something outside itself")
        key = str(given[2])
        if key not in self._storages:
            raw = self._storage_bytes(key)
            dtype = np.dtype(_STORAGES[given[1]])
            whole = len(raw) // dtype.itemsize * dtype.itemsize
            self._storages[key] = _Storage(np.frombuffer(raw[:whole], dtype))
        self.append(self._storages[key])


class _Plain:
    """Converts unpickled values to arrays and tables; it stops at a file whose parts refer to each
    other so often that they would never end.
    """

    def __init__(self) -> None:
        self._left = MAX_OPCODES

    def convert(self, value: Any, depth: int = 0) -> Any:
        """Return a value as an array or a table; what is neither is left out (None)."""
        self._left -= 1
        if depth > DEEPEST or self._left < 0:
            raise ModelFileError("its tables are nested too deeply, or too many")
        if isinstance(value, dict):
            return dict(self._entries(value.items(), depth))
        if isinstance(value, PickledArray) and value.items is not None:
            items = value.items
            return self.convert(items[0] if len(items) == 1 else items, depth + 1)
        if isinstance(value, list | tuple):
            self._left -= len(value)
            if value and all(isinstance(each, int | float) for each in value):
                return np.array(value, float)
            return dict(self._entries(enumerate(value), depth))
        if isinstance(value, int | float):
            return np.array(value, float)
        try:
            return to_array(value)
        except ModelFileError:
            return None

    def _entries(self, items: Any, depth: int) -> Iterator[tuple[str, Any]]:
        for key, each in items:
            plain = self.convert(each, depth + 1)
            if plain is not None:
                yield str(key), plain
