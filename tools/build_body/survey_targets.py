# SPDX-License-Identifier: GPL-3.0-or-later
"""The targets from which `population` makes people of all ages and measured sizes."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .source import DATA, SourceMesh, read_target

# Sliders of sex, age, build, height, proportions and ancestry.
MACRO = re.compile(r"macrodetails/.*-(baby|child|young|old)\b")
DETAILS = {  # detail -> MakeHuman's targets without their -incr and -decr, which move together
    "trunk length": ("torso/torso-scale-vert",),
    "thigh length": ("legs/upperlegs-height",),
    "shank length": ("legs/lowerlegs-height",),
    "neck length": ("neck/measure-neck-height",),
    "upper arm length": ("arms/measure-upperarm-length",),
    "forearm length": ("arms/measure-lowerarm-length",),
    "foot size": ("feet/l-foot-scale", "feet/r-foot-scale"),
    "head height": ("head/head-scale-vert",),
    "head breadth": ("head/head-scale-horiz", "head/head-scale-depth"),
    "trunk breadth": ("torso/torso-scale-horiz",),
    "hip breadth": ("hip/hip-scale-horiz",),
    "waist": ("torso/measure-waist-circ",),
    "belly": ("stomach/stomach-pregnant",),
    "hips": ("torso/measure-hips-circ",),
}
WAYS = ("incr", "decr")


@dataclass(frozen=True)
class SurveyTargets:
    """Symmetric displacements of all N source vertices, metres."""

    names: list[str]  # of the macro targets
    macro: NDArray[np.float64]  # (T, N, 3)
    details: NDArray[np.float64]  # (2 D, N, 3): for each of ``DETAILS`` both ``WAYS``


def read_survey_targets(wheel: Path, source: SourceMesh) -> SurveyTargets:
    """Read the targets of the pinned wheel that the source has not read already."""
    folder = DATA + "targets/"
    suffix = ".target.gz"
    with zipfile.ZipFile(wheel) as archive:

        def displacements(name: str) -> NDArray[np.float64]:
            if name not in source.targets:
                return read_target(archive.read(folder + name + suffix), source.mirror)
            indices, moves = source.targets[name]
            dense = np.zeros((len(source.mirror), 3))
            dense[indices] = moves
            return dense

        files = (
            f[len(folder) : -len(suffix)]
            for f in archive.namelist()
            if f.startswith(folder + "macro")
        )
        names = sorted(name for name in files if MACRO.match(name))
        return SurveyTargets(
            names,
            np.array([displacements(name) for name in names]),
            np.array(list(_details(displacements))),
        )


def _details(displacements: Callable[[str], NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    return [
        np.sum([displacements(f"{name}-{way}") for name in names], axis=0)
        for names in DETAILS.values()
        for way in WAYS
    ]
