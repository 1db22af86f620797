# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies by name or file: the built-in ones, files in the same format, and users' models."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..body import Body
from ..errors import ModelFileError
from .arrays import OPTIONAL, REQUIRED, check_arrays, check_body, check_extent
from .files import as_path, read_npz
from .model_file import is_motion, is_user_model, load_model

ASSETS = Path(__file__).resolve().parents[2] / "assets"
# The built-in bodies whose last shape coefficient leads from adult to child -> those they add it
# to.
CHILDREN = {"scope_child": "scope", "scope_child_h": "scope_h"}
_ADULTS = {"scope": ASSETS / "body" / "scope.npz", "scope_h": ASSETS / "body" / "scope_h.npz"}
BUILT_IN = _ADULTS | {child: _ADULTS[adult] for child, adult in CHILDREN.items()}
GROWTH = ASSETS / "body" / "growth.npz"
# Below, a person is more probably a child than an adult: the mean of girls and boys of eleven, 2.6
# standard deviations below that of the body's adults.
CHILD_BELOW_M = 1.45


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


def load_body(which: str | Path = "scope") -> Body:
    """Load a body by name, from a .npz in the same format, or a user's model.

    ``scope``: K = 23, P = 10; ``scope_h``: K = 51, P = 10; ``scope_child`` and ``scope_child_h``:
    the same with P = 11, the last coefficient 0 for adults and −1 for a child of six years.

    A user's SMPL, SMPL+H, SMPL-X or STAR file (.npz, or .pkl) goes through ``load_model``. Our own
    format:

    Keys: joint_names, kintree_table (2, K+1), v_template, shapedirs, J_template, J_shapedirs,
    skin_joints, skin_weights, faces, keypoint_names/part/template/shapedirs; optional uv, uv_faces,
    face_material, material_names, material_colors, name, license. Shapes as in ``Body``.

    :raises ModelFileError: the file is missing, not a body, or contradicts itself.
    :raises InvalidValueError: `which` is neither a name nor a path.
    """
    path = BUILT_IN.get(str(which), as_path(which, "which, the name or file of a body,"))
    choice = f"give one of {', '.join(BUILT_IN)}, or a body's .npz or .pkl file"
    # unlike Path.is_file also of names that are too long for the system
    if not os.path.isfile(path):
        raise ModelFileError(f"body '{which}' was not found: {choice}")
    if str(which) in BUILT_IN:
        data = _read_once(path, "body file")
    elif is_user_model(path):
        return load_model(path)
    elif is_motion(path):
        raise ModelFileError(
            f"{path} is a motion file, which holds how a body moves, not the body itself: {choice}"
        )
    else:
        data = read_npz(path, ModelFileError, "body file")
    missing = [k for k in REQUIRED if k not in data]
    if missing:
        raise ModelFileError(f"{path} lacks {', '.join(missing)}: it is not a Scope body file")
    forms = REQUIRED | OPTIONAL
    check_arrays(data, forms, path)
    for key, (kind, _) in forms.items():
        if key in data and kind == "numbers":
            data[key] = data[key].astype(np.float64)
    if str(which) in CHILDREN:
        data |= _with_growth(data, str(which))
    body = Body(
        name=str(data.get("name", path.stem)),
        joint_names=tuple(map(str, data["joint_names"])),
        parents=data["kintree_table"][0].astype(np.int32),
        keypoint_names=tuple(map(str, data["keypoint_names"])),
        keypoint_part=data["keypoint_part"].astype(np.int32),
        skin_joints=data["skin_joints"].astype(np.intp),
        faces=data["faces"].astype(np.int32),
        material_names=tuple(map(str, data.get("material_names", ()))),
        license=str(data.get("license", "")),
        v_template=data["v_template"],
        shapedirs=data["shapedirs"],
        J_template=data["J_template"],
        J_shapedirs=data["J_shapedirs"],
        skin_weights=data["skin_weights"],
        keypoint_template=data["keypoint_template"],
        keypoint_shapedirs=data["keypoint_shapedirs"],
        uv=data.get("uv"),
        uv_faces=data.get("uv_faces"),
        face_material=data.get("face_material"),
        material_colors=data.get("material_colors"),
        file="" if str(which) in BUILT_IN else str(path.resolve()),
    )
    check_body(body, path)
    check_extent(body.v_template, path)
    return body


def _read_once(path: Path, what: str) -> dict[str, NDArray[Any]]:
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
    return {key: value.copy(order="K") for key, value in _kept(path, what, changed_ns).items()}


@lru_cache(maxsize=4)
def _kept(path: Path, what: str, changed_ns: int) -> dict[str, NDArray[Any]]:
    del changed_ns  # another file of that name is read anew
    return read_npz(path, ModelFileError, what)


def _with_growth(data: dict[str, NDArray[Any]], which: str) -> dict[str, NDArray[Any]]:
    """Return the name and the shape derivatives of a body of all ages, from the arrays of the
    adult's.
    """
    columns = _read_once(GROWTH, "file of children's growth")
    changed = {"name": np.array(which)}
    for key in ("shapedirs", "J_shapedirs", "keypoint_shapedirs"):
        column = columns.get(f"{CHILDREN[which]}/{key}", np.zeros(0))
        if column.shape != data[key].shape[:2]:
            raise ModelFileError(f"{GROWTH} does not match {BUILT_IN[which]}; reinstall Scope")
        changed[key] = np.concatenate([data[key], column[..., None].astype(np.float64)], axis=2)
    return changed
