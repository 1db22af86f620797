# SPDX-License-Identifier: GPL-3.0-or-later
"""Files with a table for each camera, as other programs write them, in the form of Pose2Sim's: TOML
of Pose2Sim, Caliscope and FreeMoCap; intri.yml and extri.yml of EasyMocap; a pickle of OpenCap.

EasyMocap's two files lie in one folder. OpenCap has a folder for each camera, in all of which the
file has the same name. One of the files is given; the others are looked for beside it.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ....solver.errors import InputError
from ....solver.rotations import exp, log
from ...arrays import Float64Array
from ...json_file import LARGEST_WHOLE_NUMBER
from ...untrusted.files import check_regular, in_one_line
from ...untrusted.tables import read_tables

Tables = dict[str, dict[str, Any]]  # by camera, in the form of Pose2Sim

_TOML = (".toml",)
_YAML = (".yml", ".yaml")
_PICKLE = (".pickle", ".pkl")
SUFFIXES = (*_TOML, *_YAML, *_PICKLE)
_LARGEST = 1 << 20  # bytes
_DEEPEST = 100  # dots in a key; the time of Python's reader grows with their square
_EASYMOCAP = ("intri", "extri")  # names of its files, of lenses and of places
_MATRIX = "matrix"  # the key that a camera's table has, by any of its names
# Cameras that are so many of the file's units apart are given in millimetres.
_FAR_APART = 100.0
_MM = 1000.0
_LARGEST_TURN = 4.0 * np.pi  # of a rotation vector; more are degrees, or no rotation
_FARTHEST_M = 1e6
# A matrix of OpenCV's FileStorage: name, rows, columns and values; and a number.
_YAML_MATRIX = re.compile(
    r"^(\w+):\s*!!opencv-matrix\s+rows:\s*(\d+)\s+cols:\s*(\d+)\s+dt:\s*\w+\s+data:\s*\[([^\]!]*)\]",
    re.M,
)
_YAML_NUMBER = re.compile(r"^(\w+):\s*([-+.\deE]+)\s*$", re.M)


def has_tables(path: Path) -> bool:
    """Return whether a file is of a kind with a table for each camera, by its suffix."""
    return path.suffix.lower() in SUFFIXES


def split_camera(path: Path) -> tuple[Path, str]:
    """Return the file of a calibration, and the name of the camera in it, which may be empty."""
    text = str(path)
    sign = text.rfind("#")
    while sign > 0:
        if text[:sign].endswith(SUFFIXES) and text[sign + 1 :]:
            return Path(text[:sign]), text[sign + 1 :]
        sign = text.rfind("#", 0, sign)  # the camera's name may have one, too
    return path, ""


def files_of_calibration(path: Path) -> list[Path]:
    """Return the files that a calibration is read from; they need not exist.

    :param path: with or without the name of a camera.
    """
    file, _ = split_camera(path)
    if file.suffix.lower() in _YAML:
        return [file, *(file.with_name(f"{name}{file.suffix}") for name in _EASYMOCAP)]
    if file.suffix.lower() in _PICKLE:
        return [file, *_files_of_opencap(file)]
    return [file]


def shown_names(cameras: Iterable[str]) -> str:
    """Return the names of a file's cameras for a message."""
    return in_one_line(", ".join(cameras)) or "none"


def camera_tables(path: Path, lens_names: tuple[str, ...]) -> Tables:
    """Return the tables of a file's cameras by name, with translations in metres.

    :param lens_names: names of camera matrices; tables without one are no cameras'.
    :raises InputError: the file cannot be read.
    """
    suffix = path.suffix.lower()
    if not path.exists():
        raise InputError(f"{path} does not exist; check the path")
    if suffix in _TOML:
        tables = _of_toml(path)
    elif suffix in _YAML:
        tables = _of_easymocap(path)
    else:
        tables = _of_opencap(path)
    cameras = {
        name: table
        for name, table in tables.items()
        if isinstance(table, dict) and any(key in table for key in lens_names)
    }
    return _in_metres(cameras)


def _of_toml(path: Path) -> Tables:
    """Return all tables of a TOML file; not all of them are cameras."""
    text = _text(path)
    if any(line.partition("=")[0].count(".") > _DEEPEST for line in text.splitlines()):
        raise InputError(f"{path} is not a calibration: its tables are too deep")
    try:
        tables: Tables = _as_json_has_it(tomllib.loads(text))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not a TOML file ({in_one_line(error)})") from error
    return tables


def _as_json_has_it(value: Any) -> Any:
    """Return a value of a TOML file without dates, which become texts.

    :raises ValueError: a number is too large for floating point.
    """
    if isinstance(value, dict):
        return {key: _as_json_has_it(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_as_json_has_it(each) for each in value]
    if isinstance(value, int):
        if abs(value) > LARGEST_WHOLE_NUMBER:
            raise ValueError(f"it has a number of {len(str(abs(value)))} digits")
        return value
    return value if isinstance(value, str | float) else str(value)


def _of_easymocap(path: Path) -> Tables:
    """Return the cameras of intri.yml, with their places where there is an extri.yml beside it.

    Matrices K_NAME, and dist_NAME or D_NAME, numbers H_NAME and W_NAME; R_NAME, a rotation vector,
    or Rot_NAME, a matrix, and T_NAME, in metres.
    """
    values: dict[str, Any] = {}
    for name in _EASYMOCAP:
        file = path.with_name(f"{name}{path.suffix}")
        if not file.exists():
            if name == "intri":
                raise InputError(
                    f"{file} does not exist; put it beside {path.name}, as EasyMocap does"
                )
            continue
        text = _text(file)
        for key, rows, columns, data in _YAML_MATRIX.findall(text):
            values[key] = _matrix(file, key, int(rows), int(columns), data)
        for key, number in _YAML_NUMBER.findall(text):
            values.setdefault(key, _numbers(file, key, number))
    tables: Tables = {}
    for key, matrix in values.items():
        kind, _, name = key.partition("_")
        if kind != "K" or not name:
            continue
        table: dict[str, Any] = {_MATRIX: matrix.tolist()}
        if (dist := values.get(f"dist_{name}", values.get(f"D_{name}"))) is not None:
            table["distortions"] = dist.ravel().tolist()
        if f"W_{name}" in values and f"H_{name}" in values:
            table["size"] = [float(values[f"W_{name}"][0]), float(values[f"H_{name}"][0])]
        rotation = values.get(f"R_{name}", values.get(f"Rot_{name}"))
        if rotation is not None and f"T_{name}" in values:
            table |= _place(path, name, rotation, values[f"T_{name}"])
        tables[name] = table
    if not tables:
        raise InputError(f"{path} has no cameras: EasyMocap's intri.yml has a matrix K_ for each")
    return tables


def _of_opencap(path: Path) -> Tables:
    """Return the cameras of all files of the same name in the folders beside a file's own.

    Arrays intrinsicMat, distortion, imageSize (height, width), rotation (3, 3) and translation (3),
    in millimetres.
    """
    files = _files_of_opencap(path) or [path]
    tables: Tables = {}
    for file in files:
        check_regular(file, InputError, "calibration", _LARGEST)
        content = read_tables(file, InputError, "calibration", ())
        if "intrinsicMat" not in content:
            raise InputError(
                f"{file} is not a calibration of OpenCap: it has no intrinsicMat; choose a "
                "cameraIntrinsicsExtrinsics.pickle"
            )
        name = file.parent.name if len(files) > 1 else file.stem
        table: dict[str, Any] = {_MATRIX: _listed(content["intrinsicMat"])}
        if "distortion" in content:
            table["distortions"] = np.ravel(_array(file, "distortion", content)).tolist()
        if "imageSize" in content:
            table["size"] = np.ravel(_array(file, "imageSize", content))[::-1].tolist()
        if "rotation" in content and "translation" in content:
            rotation = _array(file, "rotation", content)
            translation = _array(file, "translation", content)
            table |= _place(file, name, rotation, translation / _MM)
        tables[name] = table
    return tables


def _files_of_opencap(path: Path) -> list[Path]:
    """Return the files of all cameras of a take, one of which is given; empty if it is alone."""
    if path.stem != "cameraIntrinsicsExtrinsics":
        return []
    siblings = path.absolute().parent.parent.glob(f"*/{path.name}")
    return sorted(siblings, key=lambda file: _number_last(file.parent.name))


def _number_last(name: str) -> tuple[str, int]:
    """Return what sorts Cam2 before Cam10."""
    digits = re.search(r"\d*$", name)
    number = digits[0] if digits else ""
    return name.removesuffix(number), int(number or 0)


def _place(
    path: Path, name: str, rotation: Float64Array, translation: Float64Array
) -> dict[str, list[float]]:
    """Return a camera's place in the form of Pose2Sim.

    :param rotation: world to camera, a matrix of 9 or a vector of 3 numbers.
    """
    if rotation.size == 9:
        R = rotation.reshape(3, 3)
        if not np.allclose(R @ R.T, np.eye(3), atol=1e-3) or np.linalg.det(R) < 0:
            raise InputError(f"{path}: the rotation of {name} is no rotation matrix")
        rotation = log(R)
    return {"rotation": rotation.ravel().tolist(), "translation": translation.ravel().tolist()}


def _in_metres(cameras: Tables) -> Tables:
    """Return cameras with places in metres; FreeMoCap's are in millimetres."""
    places = []
    for table in cameras.values():
        try:
            translation = np.array(table["translation"], float).reshape(3)
            vector = np.array(table["rotation"], float).reshape(3)
        except (KeyError, ValueError, TypeError):
            continue
        if is_place(vector, translation / _MM):
            places.append(-exp(vector).T @ translation)
    if not places or np.ptp(places, axis=0).max() <= _FAR_APART:
        return cameras
    return {
        name: table | {"translation": (np.array(table["translation"], float) / _MM).tolist()}
        if "translation" in table
        else table
        for name, table in cameras.items()
    }


def is_place(rotation: Float64Array, translation: Float64Array) -> bool:
    """Return whether a camera can be where a rotation vector (3,) and a translation (3,), in
    metres, say.
    """
    # False for what is not a number.
    turns_little = np.linalg.norm(rotation) <= _LARGEST_TURN
    return bool(turns_little and (np.abs(translation) <= _FARTHEST_M).all())


def _text(path: Path) -> str:
    check_regular(path, InputError, "calibration", _LARGEST)
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise InputError(f"{path} is not a readable calibration ({in_one_line(error)})") from error


def _matrix(path: Path, key: str, rows: int, columns: int, data: str) -> Float64Array:
    values = _numbers(path, key, data)
    if len(values) != rows * columns:
        raise InputError(
            f"{path}: {key[:80]} has {len(values)} numbers, but {rows} rows of {columns}"
        )
    return values.reshape(rows, columns)


def _numbers(path: Path, key: str, text: str) -> Float64Array:
    try:
        values = np.array([float(each) for each in text.split(",") if each.strip()])
    except ValueError as error:
        raise InputError(f"{path}: {key[:80]} is not a list of numbers") from error
    if not np.isfinite(values).all():
        raise InputError(f"{path}: {key[:80]} has values that are no finite numbers")
    return values


def _array(path: Path, key: str, content: dict[str, Any]) -> Float64Array:
    try:
        return np.array(content[key], float)
    except (ValueError, TypeError) as error:
        raise InputError(f"{path}: {key} is no array of numbers") from error


def _listed(value: Any) -> Any:
    """Return an array as lists, as TOML has it."""
    return value.tolist() if isinstance(value, np.ndarray) else value
