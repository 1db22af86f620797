# SPDX-License-Identifier: GPL-3.0-or-later
"""MPFB's default rig: the mesh with the rig's weights follows the shapes, vertex by vertex."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.face import EXPRESSIONS
from ...scope_addon.retarget.expression_map import MOVED, TURNED
from ...scope_addon.retarget.face_controls import RestBone, measure_face
from ...solver.rotations import exp
from .amounts import Amounts, Problem, eye_amounts, free_of, jacobian, share_shown
from .shapes import FaceShapes

_SIDED = ("levator05", "levator06", "oculi01", "oris03", "oris07", "risorius03")
_MOVING = ("oris01", "oris05", *(f"{bone}.{side}" for side in "LR" for bone in _SIDED))
_LIDS = tuple(f"{bone}.{side}" for side in "LR" for bone in ("orbicularis03", "orbicularis04"))
CHANNELS = [(bone, way) for bone in _MOVING for way in MOVED] + [(bone, "pitch") for bone in _LIDS]
CHANNELS += [("jaw", way) for way in ("pitch", *MOVED)]
BY_HAND: dict[str, Amounts] = {
    "eyeBlinkLeft": {("orbicularis03.L", "pitch"): 51.0},  # the lids meet
    "tongueOut": {("tongue03", "forward"): 0.45},
}
_DECIMETRES = 10.0  # in which the ridge is meant


class SkinnedFace:
    """The default rig on the mesh."""

    def __init__(self, shapes: FaceShapes) -> None:
        """Read the rig at rest and the weights."""
        rig = shapes.default
        count = len(shapes.vertices)
        self.vertices = shapes.vertices
        self.parents = {bone: rig[bone]["parent"] for bone in rig}
        self.heads = {
            bone: shapes.place(rig[bone]["head"]) for bone in rig if "head" in self._above(bone)[1:]
        }
        self.frame = measure_face(
            {bone: RestBone(head, np.eye(3)) for bone, head in self.heads.items()}
        )
        dense = {bone: np.zeros(count) for bone in shapes.weights}
        for bone, rows in shapes.weights.items():
            for vertex, weight in rows:
                dense[bone][int(vertex)] += weight
        total = np.maximum(np.sum(list(dense.values()), axis=0), 1e-9)
        self.weights = {
            bone: weight / total for bone, weight in dense.items() if bone in self.heads
        }

    def _above(self, bone: str) -> list[str]:
        return [bone, *(self._above(self.parents[bone]) if self.parents[bone] else [])]

    def moved(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far each vertex moves (N, 3) by linear blend skinning."""
        given: dict[str, dict[str, float]] = {}
        for (bone, way), value in zip(CHANNELS, x, strict=True):
            given.setdefault(bone, {})[way] = value
        axes = self.frame.axes
        turned = {}
        out = np.zeros_like(self.vertices)
        for bone, ways in given.items():
            R = axes @ exp(np.radians([ways.get(way, 0.0) for way in TURNED])) @ axes.T
            shift = axes @ [ways.get(way, 0.0) for way in MOVED] * self.frame.length(bone)
            turned[bone] = (R, self.heads[bone] + shift - R @ self.heads[bone])
        for bone, weight in self.weights.items():
            at = self.vertices
            for above in self._above(bone):  # from the bone up
                if above in turned:
                    at = at @ turned[above][0].T + turned[above][1]
            if at is not self.vertices:
                out += weight[:, None] * (at - self.vertices)
        return out


def fit_default_rig(shapes: FaceShapes) -> dict[str, Amounts]:
    """Return the amounts of the expressions in the middle and on the left, and print which share of
    each is shown.
    """
    face = SkinnedFace(shapes)
    moving = np.any([np.abs(moves).max(axis=1) > 1e-4 for moves in shapes.moves.values()], axis=0)
    rows = np.intersect1d(np.flatnonzero(moving), shapes.skin)

    def show(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return face.moved(x)[rows].ravel() * _DECIMETRES

    scale = np.array([1.0 if way in MOVED else 200.0 for _, way in CHANNELS])
    least = np.array([0.012 if way in MOVED else 0.6 for _, way in CHANNELS])
    problem = Problem(CHANNELS, show, jacobian(CHANNELS, show), scale, 0.3, least)
    found: dict[str, NDArray[np.float64]] = {}
    for name in sorted(EXPRESSIONS, key=lambda name: name == "mouthClose"):
        if name.endswith("Right"):
            continue
        target = shapes.moves[name]
        base = np.zeros(len(CHANNELS))
        if name == "mouthClose":  # lips meet although the jaw is open
            target = target + shapes.moves["jawOpen"]
            base = found["jawOpen"]
        wanted = target[rows].ravel() * _DECIMETRES
        found[name] = problem.fit(wanted, free_of(CHANNELS, name, "jaw"), base, 5)
        if wanted.any():  # not the tongue, which is no part of the skin
            print(f"{name}: {share_shown(wanted, show(base + found[name])):.0%} shown")
    return {
        name: {c: float(v) for c, v in zip(CHANNELS, x, strict=True) if v} | eye_amounts(name)
        for name, x in found.items()
    }
