# SPDX-License-Identifier: GPL-3.0-or-later
"""Glasses: two lenses in frames, a bridge and temples, fitted to a face in the model frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body

# corners of a rod's section, points around a lens
_SIDES = 8
_RIM = 40
_SQUARENESS = 3.0  # exponent of the superellipse |x/a|ⁿ + |y/b|ⁿ = 1 that is a lens' outline
_CLEARANCE_M = 0.002  # from the skin around the eye to the frame
_WRAP = 1.6  # per metre: lenses bend back by this times the square of the distance from the middle
# middle of a lens under the eye's, hinge over it
_BELOW_EYE_M = 0.004
_HINGE_M = 0.010
_EAR_Z_M = 0.03  # where a temple rests on the ear


@dataclass(frozen=True)
class Style:
    """Half width and height of a lens, and radii of the frame in the lens' plane and across it;
    metres.
    """

    half: tuple[float, float]
    frame: tuple[float, float]
    dark: bool


STYLES = {
    "thin glasses": Style((0.024, 0.018), (0.0008, 0.0008), False),
    "thick glasses": Style((0.026, 0.019), (0.0032, 0.0020), False),
    "dark glasses": Style((0.028, 0.021), (0.0026, 0.0020), True),
}


@dataclass(frozen=True)
class Mesh:
    """Vertices (N, 3), metres, and faces, each a row of their numbers."""

    vertices: NDArray[np.float64]
    faces: list[tuple[int, ...]]


def glasses(style: Style, body: Body, face: NDArray[np.float64]) -> dict[str, Mesh]:
    """Return ``frame`` and ``lenses`` on a face at rest.

    :param face: (V, 3) vertices, metres, model frame.
    """
    rims = []
    lenses = []
    rods = []
    width, height = style.half
    eyes = _eyes(body, face)
    front = _front(face, eyes, style)
    turn = np.linspace(0, 2 * np.pi, _RIM, endpoint=False)
    cosine = np.cos(turn)
    sine = np.sin(turn)
    power = 2 / _SQUARENESS
    outline = np.stack(
        [
            width * np.sign(cosine) * abs(cosine) ** power,
            height * np.sign(sine) * abs(sine) ** power,
        ],
        axis=1,
    )
    inner = []
    for side, eye in zip((1.0, -1.0), eyes, strict=True):
        middle = eye[:2] - [0.0, _BELOW_EYE_M]
        rim = _bent(middle + outline, front)
        rims.append(_rod(rim, style.frame, np.array([0.0, 0.0, 1.0]), closed=True))
        lenses.append(Mesh(rim, [tuple(range(_RIM))]))
        y = middle[1] + _HINGE_M
        hinge, bridge = _bent(
            np.array([[middle[0] + side * width, y], [middle[0] - side * width, y]]), front
        )
        inner.append(bridge)
        ear = np.array([side * _half_head(face, y), y + 0.004, _EAR_Z_M])
        rods.append(
            _rod(
                np.array([hinge, hinge + 0.06 * (ear - hinge), ear]),
                style.frame,
                np.array([1.0, 0, 0]),
            )
        )
    over_nose = (inner[0] + inner[1]) / 2 + [0.0, 0.002, 0.002]
    rods.append(
        _rod(np.array([inner[0], over_nose, inner[1]]), style.frame, np.array([0.0, 0.0, 1.0]))
    )
    return {"frame": joined(rims + rods), "lenses": joined(lenses)}


def joined(meshes: list[Mesh]) -> Mesh:
    """Return several meshes as one."""
    first = np.cumsum([0] + [len(m.vertices) for m in meshes])
    faces = [
        tuple(k + int(n) for k in face)
        for m, n in zip(meshes, first, strict=False)
        for face in m.faces
    ]
    return Mesh(np.concatenate([m.vertices for m in meshes]), faces)


def _eyes(body: Body, face: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the middle of the left and of the right eyeball."""
    white = np.unique(
        body.faces[body.face_material == list(body.material_names).index("eye_white")]
    )
    return [face[white[side * body.v_template[white, 0] > 0]].mean(axis=0) for side in (1, -1)]


def _front(face: NDArray[np.float64], eyes: list[NDArray[np.float64]], style: Style) -> float:
    """Return z of the lenses at the body's middle, so that no skin behind them comes nearer than
    the clearance.
    """
    width, height = style.half
    most = 0.0
    for eye in eyes:
        behind = (abs(face[:, 0] - eye[0]) < width) & (
            abs(face[:, 1] - eye[1] + _BELOW_EYE_M) < height
        )
        near = face[behind & (face[:, 2] > 0)]
        most = max(most, float((near[:, 2] + _WRAP * near[:, 0] ** 2).max()))
    return most + _CLEARANCE_M


def _half_head(face: NDArray[np.float64], y: float) -> float:
    beside = (abs(face[:, 1] - y) < 0.012) & (face[:, 2] > 0.045) & (face[:, 2] < 0.1)
    return float(abs(face[beside, 0]).max()) + 0.003


def _bent(xy: NDArray[np.float64], front: float) -> NDArray[np.float64]:
    return np.column_stack([xy, front - _WRAP * xy[:, 0] ** 2])


def _rod(
    path: NDArray[np.float64],
    radii: tuple[float, float],
    across: NDArray[np.float64],
    closed: bool = False,
) -> Mesh:
    """Return a rod along a path (N, 3): ``radii`` square to ``across`` and along it."""
    after = np.roll(path, -1, axis=0) if closed else np.vstack([path[1:], 2 * path[-1] - path[-2]])
    before = np.roll(path, 1, axis=0) if closed else np.vstack([2 * path[0] - path[1], path[:-1]])
    side = np.cross(after - before, across)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    turn = 2 * np.pi * np.arange(_SIDES) / _SIDES
    ring = (
        radii[0] * np.cos(turn)[:, None] * side[:, None] + radii[1] * np.sin(turn)[:, None] * across
    )
    n = len(path)
    k = np.arange(_SIDES)
    faces: list[tuple[int, ...]] = []
    for i in range(n if closed else n - 1):
        a = _SIDES * i
        b = _SIDES * ((i + 1) % n)
        faces += [
            (a + int(j), a + int(j + 1) % _SIDES, b + int(j + 1) % _SIDES, b + int(j)) for j in k
        ]
    return Mesh((path[:, None] + ring).reshape(-1, 3), faces)
