# SPDX-License-Identifier: GPL-3.0-or-later
"""The names of facial expressions, and the face of the built-in bodies: expressions, teeth and
tongue.

An expression moves vertices of the mesh at rest. Displacements add to the shape, v̄ + Σ_p β_p
shapedirs_p + Σ_k w_k e_k: neither depends on the other.

Teeth and tongue are vertices and faces after those of the body, for meshes that show the face. They
follow the head, and have their share of every shape coefficient and of every expression. The
capture does without them: what it measures is the body's skin.

In the files, displacements are sparse: expression k moves ``vertices[starts[k]:starts[k + 1]]`` by
as many rows of ``moves``, in steps of ``step_m``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.body_checks import Form, check_arrays, check_finite_array, check_index
from ...solver.body_file import BUILT_IN
from ...solver.errors import ModelFileError
from ..arrays import Float64Array, IndexArray, Uint8Array
from ..untrusted.files import read_npz

# By the names of Apple's ARKit, which game engines know; left and right are the person's.
EXPRESSIONS = (
    "browDownLeft", "browDownRight", "browInnerUp", "browOuterUpLeft", "browOuterUpRight",
    "cheekPuff", "cheekSquintLeft", "cheekSquintRight", "eyeBlinkLeft", "eyeBlinkRight",
    "eyeLookDownLeft", "eyeLookDownRight", "eyeLookInLeft", "eyeLookInRight", "eyeLookOutLeft",
    "eyeLookOutRight", "eyeLookUpLeft", "eyeLookUpRight", "eyeSquintLeft", "eyeSquintRight",
    "eyeWideLeft", "eyeWideRight", "jawForward", "jawLeft", "jawOpen", "jawRight", "mouthClose",
    "mouthDimpleLeft", "mouthDimpleRight", "mouthFrownLeft", "mouthFrownRight", "mouthFunnel",
    "mouthLeft", "mouthLowerDownLeft", "mouthLowerDownRight", "mouthPressLeft", "mouthPressRight",
    "mouthPucker", "mouthRight", "mouthRollLower", "mouthRollUpper", "mouthShrugLower",
    "mouthShrugUpper", "mouthSmileLeft", "mouthSmileRight", "mouthStretchLeft",
    "mouthStretchRight", "mouthUpperUpLeft", "mouthUpperUpRight", "noseSneerLeft",
    "noseSneerRight", "tongueOut",
)  # fmt: skip
FILE = Path(BUILT_IN["scope"]).with_name("expressions.npz")
_FORMS: dict[str, Form] = {
    "names": ("text", (None,)),
    "vertex_count": ("whole numbers", ()),
    "mouth_faces": ("whole numbers", (None,)),
}
MOUTH_FILE = Path(BUILT_IN["scope"]).with_name("mouth.npz")
_HEAD = "head"
_MOUTH_FORMS: dict[str, Form] = {
    "v_template": ("numbers", (None, 3)),
    "shapedirs": ("numbers", (None, 3, None)),
    "faces": ("whole numbers", (None, 4)),
    "uv": ("numbers", (None, 2)),
    "face_material": ("whole numbers", (None,)),
    "material_names": ("text", (None,)),
    "material_colors": ("numbers", (None, 4)),
}
# (n,) vertices and (n, 3) offsets at weight 1, metres in the model frame.
Moves = tuple[IndexArray, Float64Array]

_MOVES: dict[str, Form] = {
    "starts": ("whole numbers", (len(EXPRESSIONS) + 1,)),
    "vertices": ("whole numbers", (None,)),
    "moves": ("numbers", (None, 3)),
    "step_m": ("numbers", ()),
}


@dataclass(frozen=True)
class Expression:
    """One expression: ``vertices`` (n,) that it moves by ``offsets`` (n, 3), metres in the model
    frame, at weight 1.
    """

    name: str
    vertices: IndexArray
    offsets: Float64Array


def expressions_of(body: Body) -> tuple[Expression, ...]:
    """Return the body's expressions in the order of `EXPRESSIONS`; none of a
    user's own body.

    :raises ModelFileError: the file of the expressions is damaged.
    """
    if body.name not in BUILT_IN or body.file:
        return ()
    count, found, _ = _read()
    if len(body.v_template) == count:
        return found
    return _with_mouth() if len(body.v_template) == count + len(read_mouth().vertices) else ()


def body_with_mouth(body: Body) -> Body:
    """Return the body as its face is shown: with teeth and tongue, whose vertices come last, where
    it has expressions.

    :raises ModelFileError: one of the files is damaged.
    """
    plain = bool(expressions_of(body)) and len(body.v_template) == _read()[0]
    return with_teeth_and_tongue(body) if plain else body


def mouth_faces_of(body: Body) -> IndexArray:
    """Return which faces (n,) of the body line its mouth; none where there are no expressions.

    :raises ModelFileError: the file of the expressions is damaged.
    """
    if not expressions_of(body):
        return np.zeros(0, np.intp)
    faces = _read()[2]
    with told_to_install():
        check_index("mouth_faces", faces, len(body.faces), FILE)
    return faces


@cache
def _with_mouth() -> tuple[Expression, ...]:
    count, found, _ = _read()
    joined = zip(found, read_mouth().moves, strict=True)
    return tuple(
        Expression(
            e.name,
            np.concatenate([e.vertices, count + vertices]),
            np.concatenate([e.offsets, offsets]),
        )
        for e, (vertices, offsets) in joined
    )


@cache
def _read() -> tuple[int, tuple[Expression, ...], IndexArray]:
    data = read_face_file(FILE, "file of expressions", _FORMS)
    count = int(data["vertex_count"])
    with told_to_install():
        if tuple(data["names"]) != EXPRESSIONS:
            raise ModelFileError(
                f"{FILE}: names must be those of the {len(EXPRESSIONS)} expressions in their order"
            )
        moves = moves_of(data, count, FILE)
    found = tuple(Expression(name, *each) for name, each in zip(EXPRESSIONS, moves, strict=True))
    return count, found, data["mouth_faces"].astype(np.intp)


@dataclass(frozen=True)
class Mouth:
    """Teeth and tongue at rest: M vertices, F quads; lengths in metres, in the model frame."""

    vertices: Float64Array  # (M, 3)
    shapedirs: Float64Array  # (M, 3, 11); the last column is that of growth
    faces: NDArray[np.int32]  # (F, 4)
    uv: Float64Array  # (M, 2)
    face_material: Uint8Array  # (F,) indices into material_names
    material_names: tuple[str, ...]
    material_colors: Float64Array  # (C, 4) linear RGBA
    moves: tuple[Moves, ...]  # One for each expression, in the order of `EXPRESSIONS`.


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
    data = read_face_file(MOUTH_FILE, "file of teeth and tongue", _MOUTH_FORMS)
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
        check_arrays(data, forms, MOUTH_FILE)
        check_index("faces", data["faces"], count, MOUTH_FILE)
        check_index("face_material", data["face_material"], materials, MOUTH_FILE)
        return Mouth(
            data["v_template"].astype(float),
            data["shapedirs"].astype(float),
            data["faces"].astype(np.int32),
            data["uv"].astype(float),
            data["face_material"].astype(np.uint8),
            tuple(map(str, data["material_names"])),
            data["material_colors"].astype(float),
            moves_of(data, count, MOUTH_FILE),
        )


def read_face_file(path: Path, what: str, forms: Mapping[str, Form]) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file: those of `forms`, and those that `moves_of` takes.

    :param what: what the file should have been, for messages.
    :raises ModelFileError: the file cannot be read, or an array is missing, of another kind or
        shape, or not finite.
    """
    data = read_npz(path, ModelFileError, what)
    wanted = _MOVES | dict(forms)
    with told_to_install():
        if missing := [key for key in wanted if key not in data]:
            raise ModelFileError(f"{path} lacks {', '.join(missing)}")
        check_arrays(data, wanted, path)
        for key, (kind, _) in wanted.items():
            if kind == "numbers":
                check_finite_array(key, data[key], path)
    return data


def moves_of(data: Mapping[str, NDArray[Any]], count: int, path: Path) -> tuple[Moves, ...]:
    """Return what each expression moves, in the order of `EXPRESSIONS`.

    :param data: starts (53,), vertices (n,), moves (n, 3) and step_m, see `read_face_file`.
    :param count: number of vertices that it may move.
    :raises ModelFileError: the arrays contradict each other.
    """
    starts = data["starts"].astype(np.intp)
    vertices = data["vertices"]
    moves = data["moves"]
    if len(vertices) != len(moves):
        raise ModelFileError(
            f"{path}: vertices must be as many as moves, but are {len(vertices)} for {len(moves)}"
        )
    if starts[0] != 0 or starts[-1] != len(moves) or (np.diff(starts) < 0).any():
        raise ModelFileError(f"{path}: starts must rise from 0 to {len(moves)}")
    check_index("vertices", vertices, count, path)
    offsets = float(data["step_m"]) * moves.astype(float)
    return tuple(
        (vertices[a:b].astype(np.intp), offsets[a:b])
        for a, b in zip(starts[:-1], starts[1:], strict=True)
    )


@contextmanager
def told_to_install() -> Iterator[None]:
    """Add to errors about an installed file what to do: nobody has made or chosen it.

    :raises ModelFileError: one was raised inside.
    """
    try:
        yield
    except ModelFileError as error:
        raise ModelFileError(f"{error}; install Scope again") from error
