# SPDX-License-Identifier: Apache-2.0
"""Checks of the arrays of body files, whoever made them: no error of numpy's, no NaN, and no index
that points outside comes of any.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .body import Body
from .errors import ModelFileError
from .names import BODY_JOINTS

# SMPL-X: 10475, 55, 576125
MAX_VERTICES = 200_000
MAX_JOINTS = 500
MAX_WEIGHTS = 20_000_000

# What a file's array must hold, and its shape; None is any extent.
Form = tuple[str, tuple[int | None, ...]]
# Of a template along each axis.
_MIN_EXTENT_M = 0.01
_MAX_EXTENT_M = 50.0
_KINDS = {"numbers": "iuf", "whole numbers": "iu", "text": "U"}

REQUIRED_ARRAYS: dict[str, Form] = {
    "joint_names": ("text", (None,)),
    "kintree_table": ("whole numbers", (2, None)),
    "v_template": ("numbers", (None, 3)),
    "shapedirs": ("numbers", (None, 3, None)),
    "J_template": ("numbers", (None, 3)),
    "J_shapedirs": ("numbers", (None, 3, None)),
    "skin_joints": ("whole numbers", (None, 4)),
    "skin_weights": ("numbers", (None, 4)),
    "faces": ("whole numbers", (None, None)),
    "keypoint_names": ("text", (None,)),
    "keypoint_part": ("whole numbers", (None,)),
    "keypoint_template": ("numbers", (None, 3)),
    "keypoint_shapedirs": ("numbers", (None, 3, None)),
}
OPTIONAL_ARRAYS: dict[str, Form] = {
    "uv": ("numbers", (None, 2)),
    "uv_faces": ("whole numbers", (None, None)),
    "face_material": ("whole numbers", (None,)),
    "material_names": ("text", (None,)),
    "material_colors": ("numbers", (None, 4)),
    "name": ("text", ()),
    "license": ("text", ()),
}


def check_tables(arrays: Mapping[str, NDArray[Any]], path: Path) -> None:
    """Check the arrays of a model in SMPL's layout, all of which the file must have but shapedirs.

    :raises ModelFileError: an array of another kind or shape, or one that is not finite or points
        outside.
    """
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
    for key in ("J_regressor", "v_template", "shapedirs", "weights"):
        if key in arrays and not np.isfinite(arrays[key]).all():
            raise ModelFileError(f"{path}: {key} contains NaN or infinity; download it again")
    check_extent(arrays["v_template"].astype(np.float64), path)
    faces = arrays["f"]
    if faces.size and (int(faces.min()) < 0 or int(faces.max()) >= vertices):
        raise ModelFileError(f"{path}: f points outside 0..{vertices - 1}; download it again")


def check_arrays(arrays: Mapping[str, NDArray[Any]], forms: Mapping[str, Form], path: Path) -> None:
    """Check what the arrays of a file hold, and their shapes; arrays that are not in the file are
    not checked.

    :param arrays: by name, of the shapes in `forms`: (None, 3) is any number of rows of three.
    :raises ModelFileError: an array of another kind or shape.
    """
    for key, (kind, shape) in forms.items():
        if key not in arrays:
            continue
        array = arrays[key]
        no_names = kind == "text" and array.size == 0  # which numpy writes as numbers
        if array.dtype.kind not in _KINDS[kind] and not no_names:
            raise ModelFileError(f"{path}: {key} must hold {kind}, but holds {array.dtype}")
        if array.ndim != len(shape) or any(
            b not in (None, a) for a, b in zip(array.shape, shape, strict=True)
        ):
            wanted = ", ".join("any" if b is None else str(b) for b in shape)
            raise ModelFileError(f"{path}: {key} must have shape ({wanted}), but has {array.shape}")


def check_body(body: Body, path: Path) -> None:
    """Check shapes and index ranges of a body from a file, and that a person stands upright in it.

    :raises ModelFileError: an array has another shape, points outside, or is not finite.
    """
    n = len(body.parents)
    p = body.P
    v = len(body.v_template)
    m = len(body.keypoint_names)
    materials = max(1, len(body.material_names))
    if body.faces.shape[1] not in (3, 4):
        raise ModelFileError(
            f"{path}: faces must be triangles or quads, but have {body.faces.shape[1]} corners"
        )
    expected = {
        "J_template": (n, 3),
        "J_shapedirs": (n, 3, p),
        "v_template": (v, 3),
        "shapedirs": (v, 3, p),
        "skin_joints": (v, 4),
        "skin_weights": (v, 4),
        "keypoint_part": (m,),
        "keypoint_template": (m, 3),
        "keypoint_shapedirs": (m, 3, p),
        "uv_faces": body.faces.shape,
        "face_material": (len(body.faces),),
        "material_colors": (materials, 4),
    }
    for key, shape in expected.items():
        array = getattr(body, key)
        if array is not None and array.shape != shape:
            raise ModelFileError(f"{path}: {key} must have shape {shape}, but has {array.shape}")
    if len(body.joint_names) != n:
        raise ModelFileError(f"{path}: {len(body.joint_names)} joint names for {n} joints")
    if (
        n == 0
        or body.parents[0] != -1
        or (body.parents[1:] < 0).any()
        or (body.parents[1:] >= np.arange(1, n)).any()
    ):
        raise ModelFileError(
            f"{path}: kintree_table must list each joint after its parent, the root first"
        )
    _check_indices(body, path)
    for key, (kind, _) in (REQUIRED_ARRAYS | OPTIONAL_ARRAYS).items():
        array = getattr(body, key, None)
        if kind == "numbers" and array is not None:
            check_finite_array(key, array, path)
    check_extent(body.v_template, path)
    _check_axes(body, path)


def check_index(key: str, index: NDArray[Any], top: int, path: Path) -> None:
    """Refuse indices (...) that point outside of ``top`` entries.

    :param key: the array's name.
    :raises ModelFileError: one is negative, or ``top`` or more.
    """
    if index.size and (index.min() < 0 or index.max() >= top):
        raise ModelFileError(f"{path}: {key} points outside 0..{top - 1}")


def check_finite_array(key: str, array: NDArray[Any], path: Path) -> None:
    """Refuse numbers (...) that are not finite.

    :param key: the array's name.
    :raises ModelFileError: one is NaN or infinite.
    """
    if not np.isfinite(array).all():
        raise ModelFileError(f"{path}: {key} contains NaN or infinity")


def check_extent(v_template: NDArray[np.float64], path: Path) -> None:
    """Refuse a template (V, 3), metres, that is flat, or of another unit: no fit of it means
    anything.

    :raises ModelFileError: it measures less or more along an axis than any body, or has no
        vertices.
    """
    extent = np.ptp(v_template, axis=0) if len(v_template) else np.zeros(3)
    if not (extent.min() >= _MIN_EXTENT_M and extent.max() <= _MAX_EXTENT_M):
        size = " × ".join(f"{side:.3g}" for side in extent)
        raise ModelFileError(
            f"{path}: v_template measures {size} m, which no body does; choose a file whose unit "
            "is the metre"
        )


def _check_axes(body: Body, path: Path) -> None:
    """Refuse a person who does not stand upright, y up, with the left at +x; of other trees nothing
    is known.
    """
    J = dict(zip(body.joint_names, body.J_template, strict=True))
    if not set(BODY_JOINTS) <= set(J):
        return
    up = J["head"] - 0.5 * (J["left_ankle"] + J["right_ankle"])
    left = J["left_shoulder"] - J["right_shoulder"]
    for axis, direction, what in ((1, up, "head lies above the feet"), (0, left, "left lies")):
        if not direction[axis] > 0.5 * np.linalg.norm(direction):
            where = ", ".join(f"{x:.2g}" for x in direction)
            raise ModelFileError(
                f"{path}: the person's {what} along ({where}); turn the model so that y is up, x "
                "points to the person's left, and the person faces z"
            )


def _check_indices(body: Body, path: Path) -> None:
    """Refuse indices of joints, vertices and materials that point outside."""
    n = len(body.parents)
    v = len(body.v_template)
    materials = max(1, len(body.material_names))
    tops = {"skin_joints": n, "faces": v, "keypoint_part": n, "face_material": materials}
    if body.uv is not None:
        tops["uv_faces"] = len(body.uv)
    for key, top in tops.items():
        index = getattr(body, key)
        if index is not None:
            check_index(key, index, top, path)
