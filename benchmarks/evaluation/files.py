# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of data sets: missing and damaged ones give one sentence, and nothing that they hold is
run.

Pickles go through the product's restricted unpickler. HDF5 (MATLAB 7.3) and CDF need packages that
the product does not: they are imported on first use.
"""

from __future__ import annotations

import importlib
import io
import math
import tokenize
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.errors import SetupError
from ...scope_addon.footage import pictures_in
from ...scope_addon.untrusted.files import check_regular, read_npz
from ...scope_addon.untrusted.pickles import read_pickle, to_array
from ...solver.errors import InputError, ModelFileError

LARGEST_BYTES = 1 << 30  # of a file, and of one array in it
LARGEST_SMALL = 64 << 20  # of a regressor or an .xml file
FARTHEST_M = 1e4  # of a point from the origin; beyond that, a file's unit is not what it should be

Shape = tuple[int | None, ...]


class DatasetError(InputError):
    """A data set's folder or file is missing, damaged, or not what its publisher's is."""


def existing_folder(path: Path, what: str) -> Path:
    """Return a folder's path.

    :param what: what it holds, for the message.
    :raises DatasetError: it does not exist.
    """
    if not path.is_dir():
        raise DatasetError(
            f"{path} does not exist, where {what} are expected; docs/evaluation.md "
            "shows the folders"
        )
    return path


def existing_files(folder: Path, pattern: str, what: str) -> list[Path]:
    """Return the files of a folder that match a pattern, sorted.

    :raises DatasetError: there are none.
    """
    found = sorted(path for path in folder.glob(pattern) if path.is_file())
    if not found:
        raise DatasetError(
            f"{folder / pattern} matches no file: {what} expected; "
            "docs/evaluation.md shows the folders"
        )
    return found


def frames_in(folder: Path) -> list[Path]:
    """Return the pictures of a folder in order.

    :raises DatasetError: there is no such folder, or no picture in it.
    """
    existing_folder(folder, "the frames of a clip")
    pictures = pictures_in(folder)
    if not pictures:
        raise DatasetError(f"{folder} holds no pictures, where the frames of a clip are expected")
    return pictures


def read_table(path: Path) -> dict[str, Any]:
    """Return the dictionary of a pickle of any protocol; of its values, only those asked for by
    `array` are looked at.

    :raises DatasetError: missing, damaged, or asks for more than arrays; nothing has run then.
    """
    _check(path)
    try:
        return read_pickle(path, "a file of ground truth")
    except ModelFileError as error:
        raise DatasetError(str(error)) from None


def array(
    path: Path, table: Mapping[str, Any], key: str, shape: Shape, index: int | None = None
) -> NDArray[Any]:
    """Return an array of a pickle's table, or of a list in it.

    :param shape: that it must have; None for any extent.
    :param index: which one of the list.
    :return: numbers as float64.
    :raises DatasetError: missing, no numbers, or of another shape.
    """
    value = table.get(key)
    if index is not None:
        value = value[index] if isinstance(value, list) and index < len(value) else None
    if value is None:
        raise DatasetError(
            f"{path} lacks {key}: it is not a file of this data set; download it again"
        )
    try:
        numbers = to_array(value)
    except ModelFileError as error:
        raise DatasetError(f"{path}: {key} is not an array ({error}); download it again") from None
    return checked(path, key, numbers, shape)


def checked(path: Path, key: str, numbers: NDArray[Any], shape: Shape) -> NDArray[np.float64]:
    """Return an array as float64.

    :param shape: that it must have; None for any extent.
    :raises DatasetError: no numbers, not finite, or of another shape.
    """
    if numbers.dtype.kind not in "biuf":
        raise DatasetError(
            f"{path}: {key} must hold numbers, but holds {numbers.dtype}; download it again"
        )
    if numbers.ndim != len(shape) or any(
        b not in (None, a) for a, b in zip(numbers.shape, shape, strict=True)
    ):
        wanted = ", ".join("any" if b is None else str(b) for b in shape)
        raise DatasetError(
            f"{path}: {key} must have shape ({wanted}), but has {numbers.shape}; download it again"
        )
    values: NDArray[np.float64] = numbers.astype(np.float64)
    if not np.isfinite(values).all():
        raise DatasetError(f"{path}: {key} contains NaN or infinity; download it again")
    return values


def metres(path: Path, key: str, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (..., 3) in metres if they can be.

    :raises DatasetError: one is too far away.
    """
    if points.size and np.abs(points).max() > FARTHEST_M:
        raise DatasetError(
            f"{path}: {key} is {np.abs(points).max():.3g} m from the origin, in another unit?"
        )
    return points


def read_arrays(
    path: Path, wanted: Mapping[str, Shape], text: tuple[str, ...] = ()
) -> dict[str, NDArray[Any]]:
    """Return arrays of a .npz file, numbers as float64, and `text` as it is; nothing is unpickled.

    :raises DatasetError: missing, damaged, lacks one of them, or one of another shape or kind.
    """
    _check(path)
    found = read_npz(path, DatasetError, "file of ground truth", wanted={*wanted, *text})
    _require(path, {*wanted, *text}, found)
    return {key: checked(path, key, found[key], shape) for key, shape in wanted.items()} | {
        k: found[k] for k in text
    }


def read_matlab(path: Path, wanted: Mapping[str, Shape]) -> dict[str, NDArray[np.float64]]:
    """Return arrays of a .mat file of MATLAB 7.3, which is HDF5: its axes are in the opposite order
    of MATLAB's.

    :raises DatasetError: missing, damaged, lacks one of them, or one of another shape or kind.
    :raises SetupError: the package h5py is not installed.
    """
    h5py = _package("h5py", path)
    _check(path)
    out = {}
    try:
        with h5py.File(path, "r") as file:
            _require(path, set(wanted), set(file))
            for key, shape in wanted.items():
                # A link or a virtual data set may lead to other files of this computer.
                stored = (
                    file[key] if isinstance(file.get(key, getlink=True), h5py.HardLink) else None
                )
                if not isinstance(stored, h5py.Dataset) or stored.is_virtual or stored.external:
                    raise DatasetError(
                        f"{path}: {key} is no array of the file itself; download it again"
                    )
                if stored.size is None or stored.size * stored.dtype.itemsize > LARGEST_BYTES:
                    raise DatasetError(
                        f"{path}: {key} claims shape {stored.shape}, too large; download it again"
                    )
                out[key] = checked(path, key, stored[()], shape)
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, MemoryError) as error:
        raise DatasetError(
            f"{path} is not a readable .mat file of MATLAB 7.3 ({error}); download it again"
        ) from error
    return out


def read_poses(path: Path) -> NDArray[np.float64]:
    """Return the variable ``Pose`` (T, n) of a CDF file of Human3.6M.

    :raises DatasetError: missing, damaged, or without that variable.
    :raises SetupError: the package cdflib is not installed.
    """
    cdflib = _package("cdflib", path)
    _check(path)
    try:
        with cdflib.CDF(path) as file:
            known = file.varinq("Pose")
            if math.prod(known.Dim_Sizes) * (known.Last_Rec + 1) * 8 > LARGEST_BYTES:
                raise DatasetError(f"{path}: Pose claims too many values; download it again")
            pose = np.asarray(file.varget("Pose"))
    except DatasetError:
        raise
    except Exception as error:  # cdflib parses without checks, and so raises anything
        raise DatasetError(
            f"{path} is not a readable CDF file with a variable Pose ({error}); extract it again"
        ) from error
    return checked(
        path, "Pose", pose[0] if pose.ndim == 3 and len(pose) == 1 else pose, (None, None)
    )


def read_matrix(path: Path, shape: Shape) -> NDArray[np.float64]:
    """Return the array of a .npy file; nothing is unpickled.

    :raises DatasetError: missing, damaged, too large, or of another shape or kind.
    """
    _check(path, LARGEST_SMALL)
    try:
        found = np.lib.format.read_array(io.BytesIO(path.read_bytes()), allow_pickle=False)
    except (
        OSError,
        ValueError,
        TypeError,
        EOFError,
        MemoryError,
        SyntaxError,
        tokenize.TokenError,
    ) as error:
        raise DatasetError(
            f"{path} is not a readable .npy file ({error}); choose another"
        ) from error
    return checked(path, "the matrix", found, shape)


def _check(path: Path, largest: int = LARGEST_BYTES) -> None:
    """Refuse what does not exist, and what reading would not end of."""
    if not path.exists():
        raise DatasetError(
            f"{path} does not exist; docs/evaluation.md shows the files that are expected"
        )
    check_regular(path, DatasetError, "file of ground truth", largest)


def _require(path: Path, wanted: set[str], found: Any) -> None:
    missing = sorted(key for key in wanted if key not in found)
    if missing:
        raise DatasetError(
            f"{path} lacks {', '.join(missing)}: it is not a file of this data set; "
            "download it again"
        )


def _package(name: str, path: Path) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise SetupError(
            f"{path} cannot be read without the package {name}; ./scripts/setup installs it"
        ) from error
