# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigify's faces: points of the generated rig, as Blender evaluates it, follow the same points of
MakeHuman's mesh.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...scope_addon.errors import SetupError
from ...scope_addon.kinematics.face import EXPRESSIONS
from ...scope_addon.retarget.expression_map import MOVED, ExpressionMap
from ...scope_addon.retarget.face_controls import FaceFrame, RestBone, control_motions, measure_face
from .amounts import Amounts, Problem, eye_amounts, free_of, jacobian, share_shown
from .shapes import FaceShapes

# Points: those at the heads of bones named so, and the corners of the mouth. MPFB's lids run the
# other way.
_MIDDLE = ("lip.T", "lip.B", "chin", "nose.002")
_AT_HEADS = (
    *("lip.T.{}.001", "lip.B.{}.001", "chin.{}", "cheek.B.{}.001", "cheek.T.{}.001", "nose.{}.001"),
    *(f"lid.{row}.{{}}.00{k}" for row in "TB" for k in (1, 2, 3)),
    *(f"brow.T.{{}}.00{k}" for k in (1, 2, 3)),
)
_POINTS = (
    *_MIDDLE,
    *(f"lips.{s}" for s in "LR"),
    *(bone.format(s) for s in "LR" for bone in _AT_HEADS),
)
_CONTROLS: tuple[str, ...] = (
    "lips.{}",
    "lip.T.{}.001",
    "lip.B.{}.001",
    "lid.T.{}.002",
    "lid.B.{}.002",
    "cheek.B.{}.001",
)
_CONTROLS += ("cheek.T.{}.001", "nose.{}.001", *(f"brow.T.{{}}.00{k}" for k in (1, 2, 3)))
_MIN_AMOUNTS = {"lid": 0.04, "lips": 0.02, "lip.T": 0.02, "lip.B": 0.02, "brow": 0.02}
_LID_WEIGHT = 0.3
_BLINK: dict[bool, Amounts] = {  # by whether the face is the upgraded one: the lids meet
    False: {("lid.T.L.002", "up"): -0.9, ("lid.T.L.002", "forward"): -0.4},
    True: {
        ("lid.T.L.002", "up"): -0.95,
        ("lid.T.L.002", "forward"): -0.3,
        ("lid.T.L.001", "up"): 0.15,
    },
}


class RigifyFace:
    """A generated rig in a file."""

    def __init__(self, path: Path) -> None:
        """Append the rig to the scene.

        :raises SetupError: there is no generated rig in the file.
        """
        with bpy.data.libraries.load(str(path)) as (there, here):
            here.objects = list(there.objects)
        rigs = [obj for obj in here.objects if obj is not None and obj.type == "ARMATURE"]
        generated = [
            rig for rig in rigs if "jaw_master" in rig.data.bones and "ORG-face" in rig.data.bones
        ]
        if not generated:
            raise SetupError(f"{path} has no rig that Rigify has generated with a face")
        self.rig = generated[0]
        bpy.context.scene.collection.objects.link(self.rig)
        self.bones = {
            bone.name: RestBone(
                np.array(bone.head_local, float), np.array(bone.matrix_local.to_3x3(), float)
            )
            for bone in self.rig.data.bones
        }
        self.upgraded = "lip_end.L.001" in self.bones
        corner = "lip_end.{}.001" if self.upgraded else "lips.{}"
        controls = [
            "lip.T",
            "lip.B",
            *(bone.format(s) for s in "LR" for bone in (corner, *_CONTROLS[1:])),
        ]
        self.channels = [(bone, way) for bone in controls for way in MOVED]
        self.channels += [("jaw_master", way) for way in (*MOVED, "pitch")]
        self.channels += [(f"eye.{side}", way) for side in "LR" for way in ("pitch", "yaw")]
        self.frame, self.at_rest = measure_face(self.bones), self._points()

    def shown(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far the points move (3P,) in the face's lengths and axes."""
        controls: dict[str, dict[str, dict[str, float]]] = {}
        for (bone, way), value in zip(self.channels, x, strict=True):
            controls.setdefault(bone, {})[way] = {"jawOpen": float(value)}
        weights = np.zeros((1, len(EXPRESSIONS)))
        weights[0, EXPRESSIONS.index("jawOpen")] = 1.0
        for motion in control_motions(ExpressionMap({}, controls), weights, self.bones):
            assert motion.locations is not None
            basis = Matrix(motion.rotations[0].tolist()).to_4x4()
            basis.translation = motion.locations[0].tolist()
            self.rig.pose.bones[motion.bone].matrix_basis = basis
        return in_lengths(self._points() - self.at_rest, self.frame)

    def _points(self) -> NDArray[np.float64]:
        bpy.context.view_layer.update()
        posed = self.rig.pose.bones
        found = []
        for point in _POINTS:
            if point.startswith("lips."):
                found.append(posed[f"DEF-lip.T.{point[-1]}.001"].tail)
            else:
                found.append(
                    posed[f"DEF-{point}.L" if point in ("lip.T", "lip.B") else f"DEF-{point}"].head
                )
        return np.array(found, float)


def in_lengths(moves: NDArray[np.float64], frame: FaceFrame) -> NDArray[np.float64]:
    """Return displacements of the points (P, 3) in the lengths of a face, along its axes; lids
    weigh less.
    """
    lengths = np.array(
        [
            frame.length(point) / (_LID_WEIGHT if point.startswith("lid") else 1.0)
            for point in _POINTS
        ]
    )
    return (moves @ frame.axes / lengths[:, None]).ravel()


def wanted_moves(shapes: FaceShapes, name: str) -> NDArray[np.float64]:
    """Return how far the points of MakeHuman's mesh move (3P,) with an expression, in the lengths
    of its face.
    """
    ends = {point: _end(shapes, point) for point in _POINTS}
    rest = {point: RestBone(shapes.place(end), np.eye(3)) for point, end in ends.items()}
    rest |= {
        f"eye.{side}": RestBone(shapes.place(shapes.rigify[f"eye.{side}"]["head"]), np.eye(3))
        for side in "LR"
    }
    moves = np.array(
        [shapes.moves[name][shapes.vertices_at(end)].mean(axis=0) for end in ends.values()]
    )
    return in_lengths(moves, measure_face(rest))


def _end(shapes: FaceShapes, point: str) -> dict:
    if point.startswith("lips."):
        return shapes.rigify[f"lip.T.{point[-1]}.001"]["tail"]
    if point in ("lip.T", "lip.B"):
        return shapes.rigify[f"{point}.L"]["head"]
    if point.startswith("lid") and point.endswith(("1", "3")):
        point = point[:-1] + ("3" if point.endswith("1") else "1")
    return shapes.rigify[point]["head"]


def by_hand(face: RigifyFace) -> dict[str, Amounts]:
    """Return what is not fitted."""
    tongue = "tongue" if face.upgraded else "tongue_master"
    return {"eyeBlinkLeft": _BLINK[face.upgraded], "tongueOut": {(tongue, "forward"): 0.53}}


def fit_rigify(shapes: FaceShapes, face: RigifyFace) -> dict[str, Amounts]:
    """Return the amounts of the expressions in the middle and on the left, and print which share of
    each is shown.
    """
    moving = np.array([way in MOVED for _, way in face.channels])
    least = [
        next((v for name, v in _MIN_AMOUNTS.items() if bone.startswith(name)), 0.025)
        for bone, _ in face.channels
    ]
    for k, (bone, _) in enumerate(face.channels):
        if bone.endswith(".001") and bone.startswith(("lip.T", "lip.B")):
            least[k] = 0.025
    scale = np.where(moving, 1.0, 30.0)
    jacobian_at_rest = jacobian(face.channels, face.shown)
    problem = Problem(
        face.channels, face.shown, jacobian_at_rest, scale, 0.05, np.where(moving, least, 0.5)
    )
    found: dict[str, NDArray[np.float64]] = {}
    for name in sorted(EXPRESSIONS, key=lambda name: name == "mouthClose"):
        if name.endswith("Right"):
            continue
        wanted = wanted_moves(shapes, name)
        base = np.zeros(len(face.channels))
        for k, channel in enumerate(face.channels):
            base[k] = eye_amounts(name).get(channel, 0.0)
        if name == "mouthClose":  # lips meet although the jaw is open
            wanted = wanted + wanted_moves(shapes, "jawOpen")
            base = found["jawOpen"]
            points = wanted.reshape(-1, 3)
            for lip in ("", ".L.001", ".R.001"):
                points[_POINTS.index(f"lip.B{lip}")] = points[_POINTS.index(f"lip.T{lip}")]
        found[name] = problem.fit(wanted, free_of(face.channels, name, "jaw_master"), base, 4)
        if wanted.any():  # not the tongue, which has no points
            print(f"{name}: {share_shown(wanted, face.shown(base + found[name])):.0%} shown")
    return {
        name: {c: float(v) for c, v in zip(face.channels, x, strict=True) if v} | eye_amounts(name)
        for name, x in found.items()
    }
