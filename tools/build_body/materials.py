# SPDX-License-Identifier: GPL-3.0-or-later
"""The look: a two-tone suit that covers everything but face, neck and hands, so that the body can be shown anywhere."""

from __future__ import annotations

import numpy as np

from .joints import Skeleton
from .mesh import Mesh

MATERIALS = {  # linear RGBA
    "skin": (0.52, 0.30, 0.21, 1.0),
    "suit": (0.035, 0.06, 0.11, 1.0),
    "suit_accent": (0.02, 0.33, 0.36, 1.0),
    "eye_white": (0.80, 0.78, 0.75, 1.0),
    "eye_iris": (0.09, 0.05, 0.03, 1.0),
}


def face_materials(mesh: Mesh, skeleton: Skeleton, vertices: np.ndarray, J: np.ndarray, W: np.ndarray) -> np.ndarray:
    """(F,) index into ``MATERIALS``, symmetric.

    :param vertices: (V, 3) the mean shape in T-pose; ``J`` (K+1, 3) its joints; ``W`` (V, K+1) its skin weights.
    """
    names = list(MATERIALS)
    centre = vertices[mesh.faces].mean(axis=1)
    at = {name: J[i] for i, name in enumerate(skeleton.joint_names)}
    material = np.full(len(centre), names.index("suit"))
    material[centre[:, 1] > at["neck"][1]] = names.index("skin")
    return material
