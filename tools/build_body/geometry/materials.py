# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: a two-tone suit that leaves only head and hands bare."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..joints import Skeleton
from .loops import QuadLoops
from .mesh import Mesh

MATERIALS = {  # linear RGBA
    "skin": (0.50, 0.29, 0.20, 1.0),
    "hair": (0.030, 0.018, 0.012, 1.0),
    "suit": (0.030, 0.050, 0.090, 1.0),
    "suit_accent": (0.030, 0.290, 0.320, 1.0),
    "eye_white": (0.75, 0.73, 0.70, 1.0),
    "eye_iris": (0.10, 0.055, 0.025, 1.0),
    "eye_pupil": (0.005, 0.005, 0.005, 1.0),
}
# vertices in each ring of an eyeball; the first ring bounds the pupil, the second the iris
RING = 8
# metres relative to the eyes: z from the back of the head to the forehead, y of the line there
HAIRLINE = (
    (-0.22, -0.17, -0.13, -0.10, -0.08, -0.055, -0.03, -0.01),
    (-0.06, -0.06, -0.03, 0.02, 0.03, 0.04, 0.062, 0.066),
)
X, Y = np.eye(3)[:2]


def face_materials(
    mesh: Mesh, skeleton: Skeleton, vertices: NDArray[np.float64], J: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """Return (F,) indices into ``MATERIALS``, symmetric, with closed edge loops around limbs and
    trunk as borders.

    :param vertices: (V, 3) the mean shape in T-pose; ``J`` (K+1, 3) its joints.
    """
    names = list(MATERIALS)
    loops = QuadLoops(mesh.faces)
    centre = vertices[mesh.faces].mean(axis=1)
    mirrored = mirror_faces(mesh)

    def between(start: str, end: str, fraction: float) -> NDArray[np.float64]:
        a = J[skeleton.index(start)]
        b = J[skeleton.index(end)]
        return a + fraction * (b - a)

    def beyond(
        point: NDArray[np.float64], normal: NDArray[np.float64], radius: float
    ) -> NDArray[np.bool_]:
        """Return the faces beyond the loop nearest to the plane, on the side to which the normal
        points.
        """
        distance = np.linalg.norm(centre - point - 0.5 * radius * normal, axis=1)
        seed = int(np.where(mesh.is_eye, np.inf, distance).argmin())
        return loops.beyond(loops.nearest(vertices, point, normal, radius), seed)

    def both_sides(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        return mask | mask[mirrored]

    material = np.full(len(centre), names.index("suit"))
    waist = between("pelvis", "spine2", 0.66)
    belt = beyond(waist, -Y, 0.30) & beyond(waist - 0.04 * Y, Y, 0.30)
    boots = both_sides(beyond(between("left_knee", "left_ankle", 0.62), -Y, 0.12))
    cuffs = both_sides(beyond(between("left_elbow", "left_wrist", 0.45), X, 0.10))
    material[belt | boots | cuffs] = names.index("suit_accent")
    tilted = np.array([0.0, 0.9, 0.4]) / np.hypot(0.9, 0.4)
    head = beyond(J[skeleton.index("neck")] + [0.0, 0.03, 0.02], tilted, 0.14)
    collar = beyond(J[skeleton.index("neck")] + [0.0, 0.0, 0.02], tilted, 0.14) & ~head
    hands = both_sides(beyond(J[skeleton.index("left_wrist")], X, 0.08))
    material[collar] = names.index("suit_accent")
    material[head | hands] = names.index("skin")
    material[mesh.is_eye] = names.index("eye_white")
    for ring, name in ((2, "eye_iris"), (1, "eye_pupil")):
        material[_front_of_eyes(mesh, vertices, ring)] = names.index(name)
    from_eyes = centre - [0.0, *centre[material == names.index("eye_pupil"), 1:].mean(axis=0)]
    hair = head & (from_eyes[:, 1] > np.interp(from_eyes[:, 2], *HAIRLINE))
    material[hair & hair[mirrored]] = names.index("hair")
    return material


def mirror_faces(mesh: Mesh) -> NDArray[np.intp]:
    """Return (F,) the index of the face on the other side."""
    place = {frozenset(quad): f for f, quad in enumerate(mesh.faces.tolist())}
    return np.array([place[frozenset(quad)] for quad in mesh.mirror[mesh.faces].tolist()])


def _front_of_eyes(mesh: Mesh, vertices: NDArray[np.float64], rings: int) -> NDArray[np.bool_]:
    """Return (F,) bool: the eyeball faces inside the first ``rings`` rings around the line of
    sight.
    """
    inside = np.zeros(len(vertices), bool)
    eyeballs = np.unique(mesh.faces[mesh.is_eye])
    for side in (1.0, -1.0):
        eyeball = eyeballs[vertices[eyeballs, 0] * side > 0.0]
        offset = vertices[eyeball] - vertices[eyeball].mean(axis=0)
        sight = offset[np.argsort(-offset[:, 2], kind="stable")[: 2 * RING]].mean(axis=0)
        inside[eyeball[np.argsort(-(offset @ sight), kind="stable")[: rings * RING]]] = True
    return mesh.is_eye & inside[mesh.faces].all(axis=1)
