# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth and tongue of the built-in bodies: vertices and faces after those of the body, for meshes
that show the face.

They follow the head, and have their share of every shape coefficient and of every expression. The
capture does without them: what it measures is the body's skin.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ....solver.body_file import BUILT_IN
from ...untrusted.body_arrays import Form, check_arrays, check_index
from .face_file import Moves, moves_of, read_face_file, told_to_install

FILE = Path(BUILT_IN["scope"]).with_name("mouth.npz")
_HEAD = "head"
_FORMS: dict[str, Form] = {
    "v_template": ("numbers", (None, 3)),
    "shapedirs": ("numbers", (None, 3, None)),
    "faces": ("whole numbers", (None, 4)),
    "uv": ("numbers", (None, 2)),
    "face_material": ("whole numbers", (None,)),
    "material_names": ("text", (None,)),
    "material_colors": ("numbers", (None, 4)),
}


@dataclass(frozen=True)
class Mouth:
    """Teeth and tongue at rest: M vertices, F quads; lengths in metres, in the model frame."""

    vertices: NDArray[np.float64]  # (M, 3)
    shapedirs: NDArray[np.float64]  # (M, 3, 11); the last column is that of growth
    faces: NDArray[np.int32]  # (F, 4)
    uv: NDArray[np.float64]  # (M, 2)
    face_material: NDArray[np.uint8]  # (F,) indices into material_names
    material_names: tuple[str, ...]
    material_colors: NDArray[np.float64]  # (C, 4) linear RGBA
    moves: tuple[
        Moves, ...
    ]  # One for each expression, in the order of `expression_names.EXPRESSIONS`.


def with_teeth_and_tongue(body: Body) -> Body:
    """Return a built-in body with teeth and tongue after its own vertices and faces, which stay as
    they are.

    :raises ModelFileError: the file of teeth and tongue is damaged.
    """
    mouth = read_mouth()
    count = len(body.v_template)
    head = np.zeros((len(mouth.vertices), 4), body.skin_joints.dtype)
    head[:, 0] = body.joint_names.index(_HEAD)
    of_head = np.zeros(head.shape)
    of_head[:, 0] = 1.0
    textured: dict[str, Any] = {}
    if body.uv is not None and body.uv_faces is not None:
        textured["uv"] = np.concatenate([body.uv, mouth.uv])
        textured["uv_faces"] = np.concatenate([body.uv_faces, mouth.faces + len(body.uv)])
    if body.face_material is not None and body.material_colors is not None:
        textured["face_material"] = np.concatenate(
            [body.face_material, mouth.face_material + len(body.material_names)]
        )
        textured["material_colors"] = np.concatenate([body.material_colors, mouth.material_colors])
    return replace(
        body,
        v_template=np.concatenate([body.v_template, mouth.vertices]),
        shapedirs=np.concatenate([body.shapedirs, mouth.shapedirs[:, :, : body.P]]),
        skin_joints=np.concatenate([body.skin_joints, head]),
        skin_weights=np.concatenate([body.skin_weights, of_head]),
        faces=np.concatenate([body.faces, mouth.faces + count]).astype(body.faces.dtype),
        material_names=body.material_names + mouth.material_names,
        **textured,
    )


@cache
def read_mouth() -> Mouth:
    """Read teeth and tongue.

    :raises ModelFileError: the file is damaged.
    """
    data = read_face_file(FILE, "file of teeth and tongue", _FORMS)
    count = len(data["v_template"])
    quads = len(data["faces"])
    materials = len(data["material_names"])
    forms: dict[str, Form] = {
        "shapedirs": ("numbers", (count, 3, 11)),
        "uv": ("numbers", (count, 2)),
        "face_material": ("whole numbers", (quads,)),
        "material_colors": ("numbers", (materials, 4)),
    }
    with told_to_install():
        check_arrays(data, forms, FILE)
        check_index("faces", data["faces"], count, FILE)
        check_index("face_material", data["face_material"], materials, FILE)
        return Mouth(
            data["v_template"].astype(float),
            data["shapedirs"].astype(float),
            data["faces"].astype(np.int32),
            data["uv"].astype(float),
            data["face_material"].astype(np.uint8),
            tuple(map(str, data["material_names"])),
            data["material_colors"].astype(float),
            moves_of(data, count, FILE),
        )
