# SPDX-License-Identifier: Apache-2.0
"""Bodies by name or file: the built-in ones, files in the same format, and users' SMPL models.

Arrays are checked by ``body_checks``. Files of unknown origin go through
``scope_addon/untrusted/body_file.py``, which takes no more memory than a file has a right to, and
also reads pickles without running what they name.
"""

from __future__ import annotations

import os
import tokenize
import zipfile
import zlib
from collections.abc import Hashable, Mapping
from dataclasses import replace
from functools import lru_cache
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import described
from .body import Body
from .body_checks import OPTIONAL_ARRAYS, REQUIRED_ARRAYS, check_arrays, check_body
from .errors import InvalidValueError, ModelFileError, warn_caller
from .part import Array
from .smpl_family import MAX_BETAS, smpl_body, stored_gender

ASSETS = Path(__file__).resolve().parents[1] / "assets"
# The built-in bodies whose last shape coefficient leads from adult to child -> those they add it
# to.
CHILDREN = {"scope_child": "scope", "scope_child_h": "scope_h"}
_ADULTS = {"scope": ASSETS / "body" / "scope.npz", "scope_h": ASSETS / "body" / "scope_h.npz"}
BUILT_IN = _ADULTS | {child: _ADULTS[adult] for child, adult in CHILDREN.items()}
GROWTH = ASSETS / "body" / "growth.npz"
# Below, a person is more probably a child than an adult: the mean of girls and boys of eleven, 2.6
# standard deviations below that of the body's adults.
CHILD_BELOW_M = 1.45
_SKIN_TOLERANCE = 0.01  # of the sum of a vertex's weights
CHOICE = f"give one of {', '.join(BUILT_IN)}, or a body's .npz or .pkl file"


def body_with_hands(which: str) -> str:
    """Return the name of the built-in body with fingers for that of the one without; any other name
    as it is.
    """
    return {"scope": "scope_h", "scope_child": "scope_child_h"}.get(which, which)


def body_with_children(which: str) -> str:
    """Return the name of the built-in body of all ages for that of adults; any other name as it
    is.
    """
    return next((child for child, adult in CHILDREN.items() if adult == which), which)


def growth_of(body: Body) -> int | None:
    """Return the index of the shape coefficient that leads from adult, 0, to a child of six years,
    −1; None: none.
    """
    return body.P - 1 if body.name in CHILDREN and not body.file else None


def as_path(value: Any, name: str) -> Path:
    """Return the path of a file.

    :raises InvalidValueError: it is neither a text nor a path, or contains a null character.
    """
    if not isinstance(value, (str, os.PathLike)) or not isinstance(os.fspath(value), str):
        raise InvalidValueError(
            f"{name} must be a str or a pathlib.Path, but is {described(value)}."
        )
    if "\0" in os.fspath(value):  # what opens files refuses it with a plain ValueError
        raise InvalidValueError(
            f"{name} must be the name of a file, but contains a null character: "
            f"{os.fspath(value)!r}."
        )
    return Path(value)


def load_body(which: str | Path = "scope", betas: int = MAX_BETAS) -> Body:
    """Load a body by name, from a .npz in the same format, or a user's SMPL model.

    ``scope``: K = 23, P = 10; ``scope_h``: K = 51, P = 10; ``scope_child`` and ``scope_child_h``:
    the same with P = 11, the last coefficient 0 for adults and −1 for a child of six years.

    A user's SMPL, SMPL+H, SMPL-X or STAR model is a .npz as well; of a .pkl, take
    ``scope_addon.untrusted.body_file.load_body``, which reads its arrays without running it. A
    ``ScopeWarning`` tells what of a model is not as it may be expected: shape coefficients left
    out, skin weights that do not sum to one, a gender known from the file's name alone.

    Our own format has the keys joint_names, kintree_table (2, K+1), v_template, shapedirs,
    J_template, J_shapedirs, skin_joints, skin_weights, faces, keypoint_names/part/template/
    shapedirs; optional uv, uv_faces, face_material, material_names, material_colors, name, license.
    Shapes as in ``Body``.

    :param betas: the most shape coefficients to keep of a user's model; the leading ones are kept.
    :raises ModelFileError: the file is missing, not a body, or contradicts itself.
    :raises InvalidValueError: `which` is neither a name nor a path, or `betas` no number of them.
    """
    path = as_path(which, "which, the name or file of a body,")
    if not isinstance(betas, Integral) or betas < 0:
        raise InvalidValueError(f"betas must be a whole number of at least 0, but is {betas!r}.")
    if str(which) in BUILT_IN:
        return _built_in(str(which))
    # unlike Path.is_file also of names that are too long for the system
    if not os.path.isfile(path):
        raise ModelFileError(f"body '{which}' was not found: {CHOICE}")
    if not zipfile.is_zipfile(path):
        raise ModelFileError(
            f"{path} is not a .npz file; a pickle may run code when it is read: load it by "
            "scope_addon.untrusted.body_file.load_body"
        )
    arrays = read_arrays(path, "body file")
    if "J_regressor" in arrays:
        body = smpl_body(arrays, path, betas)
        for surprise in _surprises(arrays, body):
            warn_caller(f"{path}: {surprise}")
    else:
        body = scope_body(arrays, path)
    return replace(body, file=str(path.resolve()))


def _surprises(arrays: Mapping[str, Array], body: Body) -> list[str]:
    """Return what of a model is not as it may be expected, although it can be used."""
    found = []
    stored = arrays["shapedirs"].shape[2] if "shapedirs" in arrays else 0
    if body.P < stored:
        found.append(
            f"of {stored} shape coefficients, the first {body.P} are kept; load_body(…, betas=n) "
            "keeps n of a model's shape"
        )
    sums = arrays["weights"].sum(axis=1)
    farthest = sums[np.argmax(np.abs(sums - 1.0))]
    if abs(farthest - 1.0) > _SKIN_TOLERANCE:
        found.append(
            f"skin weights of a vertex sum to {farthest:.3g} instead of 1; they are scaled to 1"
        )
    if body.gender != "neutral" and stored_gender(arrays.get("gender")) is None:
        found.append(f"the file does not say its gender; by its name, it is taken as {body.gender}")
    return found


# What numpy and zipfile raise of a damaged file: RuntimeError where it seems to be encrypted.
_DAMAGED = (
    OSError,
    ValueError,
    EOFError,
    KeyError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
    tokenize.TokenError,
)


def read_arrays(path: Path, what: str) -> dict[str, Array]:
    """Return the arrays of a .npz file, without those that are pickled.

    :param what: what the file is, for messages.
    :raises ModelFileError: it is missing or cannot be read.
    """
    arrays = {}
    try:
        with np.load(path, allow_pickle=False) as file:
            for key in file.files:
                try:
                    arrays[key] = file[key]
                except ValueError:  # pickled, as tables of official SMPL-X files that no fit needs
                    continue
    except FileNotFoundError as error:
        raise ModelFileError(f"{path} does not exist; choose an existing {what}") from error
    except _DAMAGED as error:
        raise ModelFileError(f"{path} is not a readable {what} ({error})") from error
    return arrays


def scope_body(data: Mapping[str, Array], path: Path) -> Body:
    """Return the body of a file in our own format.

    :param data: its arrays by name: v_template (V, 3), and the others as `Body` has them.
    :raises ModelFileError: an array is missing or cannot be used, or they contradict each other.
    """
    check_arrays(data, REQUIRED_ARRAYS | OPTIONAL_ARRAYS, path)
    body = _unchecked(data, path)
    check_body(body, path)
    return body


def _unchecked(data: Mapping[str, Array], path: Path) -> Body:
    """Return the body of a file in our own format, as `scope_body`, whose arrays are right."""
    missing = [k for k in REQUIRED_ARRAYS if k not in data]
    if missing:
        raise ModelFileError(f"{path} lacks {', '.join(missing)}: it is not a Scope body file")

    def numbers(key: str) -> Array:
        return data[key].astype(np.float64)

    return Body(
        name=str(data.get("name", path.stem)),
        joint_names=tuple(map(str, data["joint_names"])),
        parents=data["kintree_table"][0].astype(np.int32),
        keypoint_names=tuple(map(str, data["keypoint_names"])),
        keypoint_part=data["keypoint_part"].astype(np.int32),
        skin_joints=data["skin_joints"].astype(np.intp),
        faces=data["faces"].astype(np.int32),
        material_names=tuple(map(str, data.get("material_names", ()))),
        license=str(data.get("license", "")),
        v_template=numbers("v_template"),
        shapedirs=numbers("shapedirs"),
        J_template=numbers("J_template"),
        J_shapedirs=numbers("J_shapedirs"),
        skin_weights=numbers("skin_weights"),
        keypoint_template=numbers("keypoint_template"),
        keypoint_shapedirs=numbers("keypoint_shapedirs"),
        uv=numbers("uv") if "uv" in data else None,
        uv_faces=data.get("uv_faces"),
        face_material=data.get("face_material"),
        material_colors=numbers("material_colors") if "material_colors" in data else None,
    )


def _built_in(which: str) -> Body:
    """Return a body of ours."""
    data = _read_once(BUILT_IN[which], "body file")
    if which in CHILDREN:
        data |= _with_growth(data, which)
    return _unchecked(data, BUILT_IN[which])


def _read_once(path: Path, what: str) -> dict[str, Array]:
    """Return the arrays of a file of ours, which stays in memory: in the panel, every change of a
    capture needs it.

    :param what: what the file is, for messages.
    :raises ModelFileError: it is missing or cannot be read.
    """
    try:
        changed_ns = path.stat().st_mtime_ns
    except OSError as error:
        raise ModelFileError(
            f"the {what} {path} cannot be read ({error.strerror}); reinstall Scope"
        ) from error
    # Copies in the files' order of memory, on which sums depend in their last bits, and the time
    # that they take.
    return {
        key: value.copy(order="K") for key, value in kept_arrays(path, what, changed_ns).items()
    }


@lru_cache(maxsize=8)
def kept_arrays(path: Path, what: str, changed: Hashable) -> dict[str, Array]:
    """Return what `read_arrays` does, which nobody may change, from memory if it was read before.

    :param changed: by which another file of that name is known, to be read anew.
    """
    return read_arrays(path, what)


def _with_growth(data: dict[str, Array], which: str) -> dict[str, Array]:
    """Return the name and the shape derivatives of a body of all ages, from the arrays of the
    adult's.
    """
    columns = _read_once(GROWTH, "file of children's growth")
    changed = {"name": np.array(which)}
    for key in ("shapedirs", "J_shapedirs", "keypoint_shapedirs"):
        column = columns.get(f"{CHILDREN[which]}/{key}", np.zeros(0))
        if column.shape != data[key].shape[:2]:
            raise ModelFileError(f"{GROWTH} does not match {BUILT_IN[which]}; reinstall Scope")
        adults = data[key].astype(np.float64)
        changed[key] = np.concatenate([adults, column[..., None].astype(np.float64)], axis=2)
    return changed
