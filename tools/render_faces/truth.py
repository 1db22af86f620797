# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the rendered faces are: the mesh in the camera's frame, and the truth of a set as a
file.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.face import expressions_of
from ...solver.body import Body
from .sequences import FaceClip

FOLDER = Path(__file__).resolve().parents[2] / "build" / "faces"
MIDDLE = np.array([0.0, 0.681, 0.11])  # of the face, in the model frame; the camera looks at it
WIDTH_M = 0.27  # that the picture shows at the face
SIZE = 256
# below the neck joint and beside the body's middle, where the picture ends
_NECK_M = 0.08
_HALF_M = 0.2


def focal_px(distance: float) -> float:
    """Return the focal length with which the face fills the picture."""
    return SIZE * distance / WIDTH_M


def head_faces(body: Body) -> NDArray[np.bool_]:
    """Return (F,) bool: which faces of the body belong to the head in the picture.

    :raises ValueError: the body has no materials, by which the head is coloured.
    """
    if body.face_material is None or body.material_colors is None:
        raise ValueError(f"body '{body.name}' has no materials")
    V = body.v_template
    neck = body.J_template[body.joint_names.index("neck"), 1]
    near: NDArray[np.bool_] = (V[:, 1] > neck - _NECK_M) & (abs(V[:, 0]) < _HALF_M)
    return near[body.faces].all(axis=1)


def head_vertices(
    body: Body, weights: NDArray[np.float64], identity: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the vertices (V, 3) in the model frame."""
    out = body.v_template.astype(float) + identity
    for w, expression in zip(weights, expressions_of(body), strict=True):
        out[expression.vertices] += w * expression.offsets
    return out


def with_expression(body: Body, weights: NDArray[np.floating[Any]]) -> Body:
    """Return the body with a face at rest that shows the weights (52,)."""
    return replace(body, v_template=head_vertices(body, np.asarray(weights, float), np.zeros(3)))


def camera_vertices(
    body: Body, clip: FaceClip, identities: NDArray[np.float64], t: int
) -> NDArray[np.float64]:
    """Return the vertices (V, 3) of frame t in the camera frame, metres."""
    return to_camera(clip, t, head_vertices(body, clip.weights[t], identities[clip.person[t]]))


def to_camera(clip: FaceClip, t: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Transform points (N, 3) of frame t from the model frame to the camera frame, metres."""
    out: NDArray[np.float64] = (points - MIDDLE) @ clip.R_camera_head[t].T + clip.middle[t]
    return out


def gaze_directions(body: Body, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit directions (2, 3) from the middle of the left and of the right eyeball to its
    pupil.
    """
    material = list(body.material_names)
    eye = np.unique(body.faces[body.face_material == material.index("eye_white")])
    pupil = np.unique(body.faces[body.face_material == material.index("eye_pupil")])
    out = np.empty((2, 3))
    for direction, sign in zip(out, (1, -1), strict=True):
        ball, front = (v[sign * body.v_template[v, 0] > 0] for v in (eye, pupil))
        # The sphere |p|² = 2 c·p + r² − |c|², by least squares.
        p = vertices[np.concatenate([ball, front])]
        c = np.linalg.lstsq(np.c_[2 * p, np.ones(len(p))], (p**2).sum(1), rcond=None)[0][:3]
        direction[:] = vertices[front].mean(axis=0) - c
        direction /= np.linalg.norm(direction)
    return out


def write_truth(path: Path, body: Body, clip: FaceClip, identities: NDArray[np.float64]) -> None:
    """Write weights (T, 52), R_camera_head, distance, person, seconds, gaze (T, 2, 3), identities
    (N, V, 3).
    """
    values: dict[str, Any] = dict(vars(clip))
    values["gaze"] = np.array(
        [
            gaze_directions(body, head_vertices(body, w, identities[p]))
            for w, p in zip(clip.weights, clip.person, strict=True)
        ]
    )
    np.savez_compressed(path, **values, identities=identities.astype(np.float32))
