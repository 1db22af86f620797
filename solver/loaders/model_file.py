# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's SMPL, SMPL+H, SMPL-X or STAR file as a ``Body``.

    J̄ = J_regressor v_template,   J_s = J_regressor shapedirs
    weights: the four largest of each vertex, scaled to sum to one

J(β) stays exactly linear, and official files have four weights at most.

Only the linear-blend-skinning part is used. The pose correctives (``posedirs``: from rotation
matrices in SMPL, from quaternions and the second shape coefficient in STAR) are left out: they move
the surface near bent joints, never the joints, so that a fitted motion is a motion of the full
model. ``Body.license`` states this.
"""

from __future__ import annotations

import re
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..body import Body
from ..errors import ModelFileError
from .arrays import Form, check_arrays, check_body, check_extent
from .files import npz_keys, read_members
from .keypoints import derive_keypoints, recognise_skeleton
from .pickles import read_pickle, to_array

MAX_BETAS = 16  # as AMASS; SMPL-X and STAR files carry 300, most of them below a millimetre
# how a full SMPL-X file divides shapedirs; older ones have 10 and 10
SMPLX_SHAPE = 300
SMPLX_EXPRESSION = 100
# SMPL-X: 10475, 55, 576125
MAX_VERTICES = 200_000
MAX_JOINTS = 500
MAX_WEIGHTS = 20_000_000
STAR_CORRECTIVES = 93  # 23 quaternions and one shape coefficient; SMPL has 207

_NUMERIC = ("v_template", "shapedirs", "J_regressor", "kintree_table", "weights", "f")
_REQUIRED = tuple(key for key in _NUMERIC if key != "shapedirs")
_TEXT = ("gender", "joint_names")
_GENDERS = {"m": "male", "f": "female", "male": "male", "female": "female", "neutral": "neutral"}


@dataclass(frozen=True)
class Tables:
    """What a model file holds, as arrays; ``correctives`` is the last extent of posedirs, 0 when
    absent.
    """

    arrays: dict[str, NDArray[Any]]
    correctives: int


def is_user_model(path: Path) -> bool:
    """Whether a file is one for ``load_model``: a pickle, or a .npz with a joint regressor. Cheap;
    reads no array.
    """
    return path.suffix.lower() in (".pkl", ".pickle") or "J_regressor" in npz_keys(path)


def is_motion(path: Path) -> bool:
    """Whether a .npz holds poses and no body, as AMASS's files and our own motions do. Cheap; reads
    no array.
    """
    keys = npz_keys(path)
    return {"poses", "trans"} <= keys and "v_template" not in keys


def load_model(path: str | Path, max_betas: int = MAX_BETAS) -> Body:
    """Load a user's SMPL, SMPL+H, SMPL-X or STAR file, .npz or .pkl. The file may be hostile;
    nothing in it is run.

    Needs v_template (V, 3), weights (V, K+1), J_regressor (K+1, V), kintree_table (2, K+1) with
    par(i) < i and f (F, 3); takes shapedirs (V, 3, P'), gender and joint_names when present.
    Metres, y up, facing +z.

    :param max_betas: the most shape coefficients to keep, 0 to 300; the leading ones are kept.
    :return: a ``Body`` named smpl, smplh, smplx, star, or after the file when the tree is none of
        these.
    :raises ModelFileError: missing, unreadable, not a body, contradicts itself, or asks for more
        than arrays.
    """
    path = Path(path)
    if not path.is_file():
        raise ModelFileError(
            f"{path} does not exist; choose an SMPL, SMPL+H, SMPL-X or STAR file (.npz or .pkl)"
        )
    if not 0 <= max_betas <= SMPLX_SHAPE:
        raise ModelFileError(f"max_betas must lie in 0..{SMPLX_SHAPE}, but is {max_betas}")
    tables = _read_tables(path)
    try:
        body = _make_body(tables, path, max_betas)
    except MemoryError as cause:
        raise ModelFileError(
            f"{path} is too large for this computer's memory; choose a smaller body file"
        ) from cause
    check_body(body, path)
    return replace(
        body, gender=read_gender(tables.arrays.get("gender"), path), file=str(path.resolve())
    )


def _read_tables(path: Path) -> Tables:
    if zipfile.is_zipfile(path):
        arrays, posedirs = read_members(path, (*_NUMERIC, *_TEXT), shape_of="posedirs")
    else:
        content = read_pickle(path)
        try:
            arrays = {key: to_array(content[key]) for key in _NUMERIC if key in content}
            posedirs = to_array(content["posedirs"]).shape if "posedirs" in content else ()
            if isinstance(content.get("gender"), str | bytes):
                arrays["gender"] = to_array(content["gender"])
        except (ModelFileError, ValueError, TypeError, IndexError, OverflowError) as cause:
            raise ModelFileError(
                f"{path} cannot be used as a body: {cause}; get it from its publisher again"
            ) from None
    missing = [key for key in _REQUIRED if key not in arrays]
    if missing:
        raise ModelFileError(
            f"{path} lacks {', '.join(missing)}: it is not an SMPL, SMPL+H, SMPL-X or STAR body; "
            "choose another file"
        )
    _check_tables(arrays, path)
    return Tables(arrays, posedirs[-1] if posedirs else 0)


def _check_tables(arrays: dict[str, NDArray[Any]], path: Path) -> None:
    """Check types and shapes."""
    check_arrays(
        arrays,
        {"kintree_table": ("whole numbers", (2, None)), "v_template": ("numbers", (None, 3))},
        path,
    )
    vertices = len(arrays["v_template"])
    n = arrays["kintree_table"].shape[1]
    if 0 in (vertices, n):
        raise ModelFileError(
            f"{path}: {vertices} vertices and {n} joints do not match any supported body; choose "
            "another file"
        )
    if vertices > MAX_VERTICES or n > MAX_JOINTS or vertices * n > MAX_WEIGHTS:
        raise ModelFileError(
            f"{path}: {vertices} vertices and {n} joints are too many for a body; choose another"
        )
    forms: dict[str, Form] = {
        "weights": ("numbers", (vertices, n)),
        "J_regressor": ("numbers", (n, vertices)),
        "f": ("whole numbers", (None, 3)),
        "shapedirs": ("numbers", (vertices, 3, None)),
    }
    check_arrays(arrays, forms, path)


def _make_body(tables: Tables, path: Path, max_betas: int) -> Body:
    arrays = tables.arrays
    parents = _parents(arrays["kintree_table"], path)
    skeleton = recognise_skeleton(parents)
    name = skeleton.name if skeleton else path.stem
    if name == "smpl" and tables.correctives == STAR_CORRECTIVES:
        name = "star"
    v_template = arrays["v_template"].astype(np.float64)
    shapedirs = _shapedirs(arrays.get("shapedirs"), len(v_template), name, max_betas)
    regressor = arrays["J_regressor"].astype(np.float64)
    skin_joints, skin_weights = reduce_weights(arrays["weights"], path)
    for key, array in (
        ("J_regressor", regressor),
        ("v_template", v_template),
        ("shapedirs", shapedirs),
    ):
        if not np.isfinite(array).all():
            raise ModelFileError(f"{path}: {key} contains NaN or infinity; download it again")
    check_extent(v_template, path)
    body = Body(
        name=name,
        joint_names=skeleton.joint_names
        if skeleton
        else _joint_names(arrays.get("joint_names"), len(parents)),
        parents=parents,
        J_template=regressor @ v_template,
        J_shapedirs=np.tensordot(regressor, shapedirs, axes=1),
        v_template=v_template,
        shapedirs=shapedirs,
        skin_joints=skin_joints,
        skin_weights=skin_weights,
        faces=_faces(arrays["f"], len(v_template), path),
        license=_license(name, path),
    )
    return derive_keypoints(body)


def _parents(kintree: NDArray[np.integer[Any]], path: Path) -> NDArray[np.int32]:
    """Return the parents (K+1,). Row 1 names the joints, row 0 the parents; the root's is 2³² − 1,
    −1 or itself.
    """
    columns = {int(name): column for column, name in enumerate(kintree[1])}
    if len(columns) != kintree.shape[1]:
        raise ModelFileError(f"{path}: kintree_table names a joint twice; download it again")
    parents = np.array([-1, *(columns.get(int(name), -1) for name in kintree[0, 1:])], np.int32)
    if (parents[1:] < 0).any() or (parents[1:] >= np.arange(1, len(parents))).any():
        raise ModelFileError(
            f"{path}: kintree_table must list each joint after its parent, the root first"
        )
    return parents


def _shapedirs(
    shapedirs: NDArray[Any] | None, vertices: int, name: str, max_betas: int
) -> NDArray[np.float64]:
    """Return the leading shape directions (V, 3, P), without the facial expressions that SMPL-X
    stores after them.
    """
    if shapedirs is None:
        return np.zeros((vertices, 3, 0))
    count = shapedirs.shape[2]
    if name == "smplx":
        count = min(count, SMPLX_SHAPE if count >= SMPLX_SHAPE + SMPLX_EXPRESSION else 10)
    return shapedirs[:, :, : min(count, max_betas)].astype(np.float64)


def reduce_weights(
    weights: NDArray[Any], path: Path
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the four largest skin weights of each vertex, scaled to sum to one; weights below zero
    count as zero.

    :param weights: (V, K+1).
    :return: skin_joints (V, 4) int and skin_weights (V, 4); with fewer than four joints, the rest
        is joint 0 at zero.
    :raises ModelFileError: a weight is not finite, or a vertex has none that is positive.
    """
    if not np.isfinite(weights).all():
        raise ModelFileError(f"{path}: weights contains NaN or infinity; download it again")
    weights = np.maximum(weights.astype(np.float64), 0.0)
    if weights.shape[1] < 4:
        weights = np.pad(weights, ((0, 0), (0, 4 - weights.shape[1])))
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    kept = np.take_along_axis(weights, joints, axis=1)
    total = kept.sum(axis=1, keepdims=True)
    if not np.isfinite(total).all() or (total <= 0).any():
        raise ModelFileError(f"{path}: weights leaves a vertex without a joint; download it again")
    joints[kept == 0.0] = 0
    return joints, kept / total


def _faces(faces: NDArray[np.integer[Any]], vertices: int, path: Path) -> NDArray[np.int32]:
    if faces.size and (int(faces.min()) < 0 or int(faces.max()) >= vertices):
        raise ModelFileError(f"{path}: f points outside 0..{vertices - 1}; download it again")
    return faces.astype(np.int32)


def _joint_names(names: NDArray[Any] | None, count: int) -> tuple[str, ...]:
    if (
        names is not None
        and names.shape == (count,)
        and names.dtype.kind == "U"
        and len(set(names.tolist())) == count
    ):
        return tuple(names.tolist())
    return tuple(f"joint_{i:02d}" for i in range(count))


def read_gender(stored: NDArray[Any] | None, path: Path) -> str:
    """Return male, female or neutral: as the file says, else as its name or its folder's says, else
    neutral.

    :param stored: () text, what the file holds as gender.
    """
    if stored is not None and stored.size == 1 and stored.dtype.kind in "SU":
        item = stored.reshape(-1)[0]
        text = (item.decode("latin1") if isinstance(item, bytes) else str(item)).strip().lower()
        if text in _GENDERS:
            return _GENDERS[text]
    for text in (path.stem, path.parent.name):
        for word in re.split(r"[^a-z]+", text.lower()):
            if word in _GENDERS:
                return _GENDERS[word]
    return "neutral"


def _license(name: str, path: Path) -> str:
    return (
        f"Read from the user's own file {path.name} ({name}): its publisher's licence holds for "
        "mesh and shape. "
        "Pose correctives are not used."
    )
