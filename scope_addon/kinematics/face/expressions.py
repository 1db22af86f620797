# SPDX-License-Identifier: GPL-3.0-or-later
"""The facial expressions of the built-in bodies: how far each moves the vertices of the mesh at
rest.

Displacements add to the shape, v̄ + Σ_p β_p shapedirs_p + Σ_k w_k e_k: neither depends on the
other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ....solver.body_file import BUILT_IN
from ....solver.errors import ModelFileError
from ...expression_names import EXPRESSIONS
from ...untrusted.body_arrays import Form, check_index
from .face_file import moves_of, read_face_file, told_to_install
from .mouth import read_mouth, with_teeth_and_tongue

FILE = Path(BUILT_IN["scope"]).with_name("expressions.npz")
_FORMS: dict[str, Form] = {
    "names": ("text", (None,)),
    "vertex_count": ("whole numbers", ()),
    "mouth_faces": ("whole numbers", (None,)),
}


@dataclass(frozen=True)
class Expression:
    """One expression: ``vertices`` (n,) that it moves by ``offsets`` (n, 3), metres in the model
    frame, at weight 1.
    """

    name: str
    vertices: NDArray[np.intp]
    offsets: NDArray[np.float64]


def expressions_of(body: Body) -> tuple[Expression, ...]:
    """Return the body's expressions in the order of `expression_names.EXPRESSIONS`; none of a
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


def mouth_faces_of(body: Body) -> NDArray[np.intp]:
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
def _read() -> tuple[int, tuple[Expression, ...], NDArray[np.intp]]:
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
