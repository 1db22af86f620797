# SPDX-License-Identifier: GPL-3.0-or-later
"""How a body changes from child to adult: one more shape coefficient, for the bodies of children.

Its column is the mean adult of `shape_space` minus the mean six-year-old of growth tables
(`anthropometry.CHILDREN`), made to measure by `population`: at −1, the adult's shape becomes the
child's. Positive is taller, as for the others.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..build import ShapedMesh, rig_body
from ..joints import make_skeleton
from ..population import mean_child
from ..survey_targets import SurveyTargets
from .mesh import smooth_nipples, smooth_perineum

YEARS = 6.0
KEYS = ("shapedirs", "J_shapedirs", "keypoint_shapedirs")


def build_growth(shaped: ShapedMesh, targets: SurveyTargets) -> dict[str, NDArray[Any]]:
    """Return the additional columns of both bodies, (n, 3) metres each, by ``BODY/KEY`` with the
    body's name and key.

    :param targets: of all ages.
    """
    grown = with_growth(shaped, targets)
    columns: dict[str, NDArray[Any]] = {}
    for with_hands in (False, True):
        skeleton = make_skeleton(shaped.source, with_hands)
        arrays = rig_body(grown, skeleton)
        columns |= {f"{skeleton.name}/{key}": arrays[key][..., -1] for key in KEYS}
    return columns


def with_growth(shaped: ShapedMesh, targets: SurveyTargets) -> ShapedMesh:
    """Return the mesh with one more component, by which the child follows from the adult."""
    child = smooth_nipples(shaped.source, mean_child(shaped.source, targets, YEARS)[None])
    child = smooth_perineum(shaped.mesh, np.concatenate([shaped.basis[:1], child]))[1:]
    return ShapedMesh(
        shaped.source, shaped.mesh, np.concatenate([shaped.basis, shaped.basis[:1] - child])
    )
