# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies by name or file: the built-in ones, files in the same format, and users' models."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..body import Body
from ..errors import ModelFileError
from .arrays import OPTIONAL, REQUIRED, check_arrays, check_body
from .model_file import is_motion, is_user_model, load_model
from .npz import read_npz

ASSETS = Path(__file__).resolve().parents[2] / "assets"
BUILT_IN = {"scope": ASSETS / "body" / "scope.npz", "scope_h": ASSETS / "body" / "scope_h.npz"}


def body_with_hands(which: str) -> str:
    """Return the name of the built-in body with fingers for that of the one without; any other name as it is."""
    return "scope_h" if which == "scope" else which


def load_body(which: str | Path = "scope") -> Body:
    """Load a body by name (``scope``: K = 23, ``scope_h``: K = 51), from a .npz in the same format, or a user's model.

    A user's SMPL, SMPL+H, SMPL-X or STAR file (.npz, or .pkl) goes through ``load_model``. Our own format:

    Keys: joint_names, kintree_table (2, K+1), v_template, shapedirs, J_template, J_shapedirs, skin_joints,
    skin_weights, faces, keypoint_names/part/template/shapedirs; optional uv, uv_faces, face_material,
    material_names, material_colors, name, license. Shapes as in ``Body``.

    :raises ModelFileError: the file is missing, not a body, or contradicts itself.
    """
    path = BUILT_IN.get(str(which), Path(which))
    choice = f"give one of {', '.join(BUILT_IN)}, or a body's .npz or .pkl file"
    if not path.is_file():
        raise ModelFileError(f"body '{which}' was not found: {choice}")
    if is_user_model(path):
        return load_model(path)
    if is_motion(path):
        raise ModelFileError(f"{path} is a motion file, which holds how a body moves, not the body itself: {choice}")
    data = read_npz(path, ModelFileError, "body file")
    missing = [k for k in REQUIRED if k not in data]
    if missing:
        raise ModelFileError(f"{path} lacks {', '.join(missing)}: it is not a Scope body file")
    forms = REQUIRED | OPTIONAL
    check_arrays(data, forms, path)
    for key, (kind, _) in forms.items():
        if key in data and kind == "numbers":
            data[key] = data[key].astype(np.float64)
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
    return body
