# SPDX-License-Identifier: GPL-3.0-or-later
"""The clip's camera, motion and ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.axes import world_from_level_camera
from ...solver.body import Body
from ..render_faces.truth import with_expression
from ..render_sample.truth import Shot, write_truth
from .choreography import DURATION, body_motion, face_motion

FOLDER = Path(__file__).resolve().parents[2] / "build" / "talk"
VIDEO = "talk.mp4"
TRUTH = "talk_truth.npz"
FPS = 30
SIZE = (512, 512)
INTRINSICS = np.array([[850.0, 0.0, 255.5], [0.0, 850.0, 255.5], [0.0, 0.0, 1.0]])
_TILT = np.radians(3.0)
_HEIGHT = 1.41
_DISTANCE = 1.72


@dataclass(frozen=True)
class TalkShot(Shot):
    """A shot of a person whose face moves: ``weights`` (T, 52) of the expressions."""

    weights: NDArray[np.float64]

    def vertices_world(self, body: Body, frame: int) -> NDArray[np.float64]:
        """Return the skin's vertices (V, 3) in one frame, world, metres."""
        return super().vertices_world(with_expression(body, self.weights[frame]), frame)


def talk_shot(body: Body) -> TalkShot:
    """Return the clip's shot.

    :param body: a built-in one with fingers.
    """
    times = np.arange(round(DURATION * FPS)) / FPS
    rotations, trans = body_motion(body, times)
    camera = world_from_level_camera(np.array([0.0, -np.cos(_TILT), -np.sin(_TILT)]), _HEIGHT)
    camera[1, 3] = -_DISTANCE
    standing = np.ones((len(times), 2), bool)
    betas = np.zeros(body.P)
    return TalkShot(
        rotations, trans, betas, INTRINSICS, camera, SIZE, FPS, standing, face_motion(times)
    )


def write_talk_truth(path: Path, body: Body, shot: TalkShot) -> None:
    """Write the ground truth as `write_truth` does, and ``expressions`` (T, 52)."""
    write_truth(path, body, shot)
    with np.load(path) as data:
        values = {key: data[key] for key in data.files}
    np.savez_compressed(path, **values, expressions=shot.weights.astype(np.float32))
