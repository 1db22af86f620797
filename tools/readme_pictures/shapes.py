# SPDX-License-Identifier: GPL-3.0-or-later
"""The shapes in the pictures: the posed body of a motion, and a stick figure of true joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.overlay_video import camera_vertices
from ...scope_addon.kinematics.face import mouth_faces_of
from ...scope_addon.motion import Motion
from ...solver import Body
from ..render_faces.truth import with_expression

STICKS = (
    ("LShoulder", "RShoulder"), ("LHip", "RHip"), ("LShoulder", "LHip"), ("RShoulder", "RHip"),
    ("LShoulder", "LElbow"), ("LElbow", "LWrist"), ("RShoulder", "RElbow"), ("RElbow", "RWrist"),
    ("LHip", "LKnee"), ("LKnee", "LAnkle"), ("RHip", "RKnee"), ("RKnee", "RAnkle"),
    ("LAnkle", "LHeel"), ("LHeel", "LBigToe"), ("RAnkle", "RHeel"), ("RHeel", "RBigToe"),
    ("Neck", "Head"),
)  # fmt: skip
HIPS = (1, 2)  # SMPL's joints
_SIDES = 12  # of a stick
_OWN = {  # colours of materials
    "eye_white": (0.93, 0.95, 0.98), "eye_iris": (0.13, 0.20, 0.33),
    "eye_pupil": (0.05, 0.07, 0.12),
    "teeth": (0.70, 0.78, 0.89), "gums": (0.16, 0.25, 0.42), "tongue": (0.20, 0.32, 0.53),
}  # fmt: skip


def posed(motion: Motion, body: Body, row: int) -> NDArray[np.float64]:
    """Return the body's vertices (V, 3) at a row, with its expression, metres, world."""
    return to_world(motion, row, posed_in_camera(motion, body, row))


def posed_in_camera(motion: Motion, body: Body, row: int) -> NDArray[np.float64]:
    """Return the body's vertices (V, 3) at a row, with its expression, metres, in the axes of the
    row's camera.
    """
    shown = with_expression(body, motion.face["expressions"][row]) if motion.face else body
    return camera_vertices(motion, shown, row)


def colors_with_face(body: Body, color: tuple[float, ...]) -> NDArray[np.float64]:
    """Return a colour (F, 3) for each face of a built-in body: one for all but eyes and mouth."""
    out = np.tile(color, (len(body.faces), 1))
    assert body.face_material is not None  # the built-in bodies have materials
    for number, name in enumerate(body.material_names):
        if name in _OWN:
            out[body.face_material == number] = _OWN[name]
    out[mouth_faces_of(body)] = 0.3 * np.array(color)
    return out


def joints(motion: Motion, row: int) -> NDArray[np.float64]:
    """Return the captured joints (K+1, 3), metres, world."""
    return to_world(motion, row, motion.joints_cam[row])


def to_world(motion: Motion, row: int, points_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """Transform points (..., 3) from a row's camera frame to the motion's world."""
    T = motion.world_from_camera[row]
    return np.asarray(points_camera, float) @ T[:3, :3].T + T[:3, 3]


def true_joints(motion: Motion, row: int, truth: Path) -> dict[str, NDArray[np.float64]]:
    """Return the true joints by name, moved so that the middle of the hips is the captured one;
    world, metres.

    The same alignment as MPJPE-root's: nothing is rotated or scaled.

    :raises ValueError: when the ground truth does not have this frame.
    """
    with np.load(truth) as file:
        rows = np.flatnonzero(file["frame_index"] == motion.frames[row])
        if len(rows) == 0:
            raise ValueError(
                f"{truth.name} does not have frame {motion.frames[row]}; choose another one"
            )
        found = dict(
            zip(map(str, file["names"]), file["joints"][rows[0]].astype(float), strict=True)
        )
    shift = motion.joints_cam[row, HIPS, :].mean(0) - (found["LHip"] + found["RHip"]) / 2
    return {
        name: to_world(motion, row, p + shift) for name, p in found.items() if np.isfinite(p).all()
    }


def stick_figure(
    points: dict[str, NDArray[np.float64]], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return a mesh of rods between joints: (V, 3) vertices and (F, 3) triangles, counter-clockwise
    from outside.
    """
    rods = [_rod(points[a], points[b], radius) for a, b in STICKS if a in points and b in points]
    vertices = np.concatenate([v for v, _ in rods])
    first = np.cumsum([0] + [len(v) for v, _ in rods[:-1]])
    return vertices, np.concatenate([t + k for (_, t), k in zip(rods, first, strict=True)])


def _rod(
    a: NDArray[np.float64], b: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return a rod with round ends: rings of vertices whose radius follows a half circle at either
    end.
    """
    length = float(np.linalg.norm(b - a))
    axis = (b - a) / max(length, 1e-9)
    across = np.cross(axis, np.eye(3)[np.argmin(abs(axis))])
    across /= np.linalg.norm(across)
    other = np.cross(axis, across)
    round_end = np.linspace(0, np.pi / 2, 5)
    along = np.concatenate([-np.cos(round_end) * radius, length + np.sin(round_end) * radius])
    wide = np.concatenate([np.sin(round_end), np.cos(round_end)]) * radius
    turn = 2 * np.pi * np.arange(_SIDES) / _SIDES
    ring = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * other
    vertices = a + along[:, None, None] * axis + wide[:, None, None] * ring
    k = np.arange(_SIDES)
    n = np.roll(np.arange(_SIDES), -1)
    quads = [
        np.stack([k, n, n + _SIDES, k + _SIDES], 1) + _SIDES * i for i in range(len(along) - 1)
    ]
    faces = np.concatenate(quads)
    return vertices.reshape(-1, 3), np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
