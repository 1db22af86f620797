# SPDX-License-Identifier: GPL-3.0-or-later
"""The facial expressions of the built-in bodies: how far each moves the vertices of the mesh at rest.

Displacements add to the shape, v̄ + Σ_p β_p shapedirs_p + Σ_k w_k e_k: neither depends on the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ....solver.errors import ModelFileError
from ....solver.loaders.body_file import BUILT_IN
from ....solver.loaders.npz import read_npz
from .mouth import read_mouth, with_teeth_and_tongue

FILE = Path(BUILT_IN["scope"]).with_name("expressions.npz")


@dataclass(frozen=True)
class Expression:
    """One expression: ``vertices`` (n,) that it moves by ``offsets`` (n, 3), metres in the model frame, at weight 1."""

    name: str
    vertices: NDArray[np.intp]
    offsets: NDArray[np.float64]


def expressions_of(body: Body) -> tuple[Expression, ...]:
    """Return the body's expressions in the order of `solver.names.EXPRESSIONS`; none of a user's own body.

    :raises ModelFileError: the file of the expressions is damaged.
    """
    if body.name not in BUILT_IN or body.file:
        return ()
    count, found, _ = _read()
    if len(body.v_template) == count:
        return found
    return _with_mouth() if len(body.v_template) == count + len(read_mouth().vertices) else ()


def body_with_mouth(body: Body) -> Body:
    """Return the body as its face is shown: with teeth and tongue, whose vertices come last, where it has expressions.

    :raises ModelFileError: one of the files is damaged.
    """
    plain = bool(expressions_of(body)) and len(body.v_template) == _read()[0]
    return with_teeth_and_tongue(body) if plain else body


def mouth_faces_of(body: Body) -> NDArray[np.intp]:
    """Return which faces (n,) of the body line its mouth; none where there are no expressions.

    :raises ModelFileError: the file of the expressions is damaged.
    """
    return _read()[2] if expressions_of(body) else np.zeros(0, np.intp)


@cache
def _with_mouth() -> tuple[Expression, ...]:
    count, found, _ = _read()
    joined = zip(found, read_mouth().moves, strict=True)
    return tuple(
        Expression(e.name, np.concatenate([e.vertices, count + vertices]), np.concatenate([e.offsets, offsets]))
        for e, (vertices, offsets) in joined
    )


@cache
def _read() -> tuple[int, tuple[Expression, ...], NDArray[np.intp]]:
    data = read_npz(FILE, ModelFileError, "file of expressions")
    try:
        starts, step = data["starts"], float(data["step_m"])
        found = tuple(
            Expression(str(name), data["vertices"][a:b].astype(np.intp), step * data["moves"][a:b].astype(float))
            for name, a, b in zip(data["names"], starts[:-1], starts[1:], strict=True)
        )
        return int(data["vertex_count"]), found, data["mouth_faces"].astype(np.intp)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise ModelFileError(f"{FILE} is damaged ({error}); install Scope again") from error
