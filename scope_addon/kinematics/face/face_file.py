# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of the built-in bodies' faces: what each expression moves, and checks of what they hold.

Displacements are sparse: expression k moves ``vertices[starts[k]:starts[k + 1]]`` by as many rows
of ``moves``, in steps of ``step_m``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver.errors import ModelFileError
from ...expression_names import EXPRESSIONS
from ...untrusted.body_arrays import Form, check_arrays, check_finite_array, check_index
from ...untrusted.files import read_npz

# (n,) vertices and (n, 3) offsets at weight 1, metres in the model frame.
Moves = tuple[NDArray[np.intp], NDArray[np.float64]]

_MOVES: dict[str, Form] = {
    "starts": ("whole numbers", (len(EXPRESSIONS) + 1,)),
    "vertices": ("whole numbers", (None,)),
    "moves": ("numbers", (None, 3)),
    "step_m": ("numbers", ()),
}


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
    """Return what each expression moves, in the order of `expression_names.EXPRESSIONS`.

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
