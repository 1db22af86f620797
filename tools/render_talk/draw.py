# SPDX-License-Identifier: GPL-3.0-or-later
"""The clip's pictures: a person, drawn by the rasterizer of overlays, in front of the room of the
sample clip.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.fitting.rasterizer import Canvas, rasterize, vertex_normals
from ...scope_addon.capture.media.video_writer import VideoWriter
from ...scope_addon.kinematics.face import mouth_faces_of
from ...solver.body import Body
from ..render_faces.looks import HAIR, draw_look
from ..render_faces.shaded import hollows
from .shot import TalkShot

_OVER = 2  # pixels are drawn so many times finer
_LOOK = 8  # seed of the colours
_LIGHTS = np.array([[-0.5, -0.7, -0.5], [0.8, -0.2, -0.6]])  # directions to them, camera frame
_STRENGTH = np.array([0.55, 0.18])
_AMBIENT = 0.42
_CONCAVE = 100.0  # per metre: how much darker hollows are


class PersonPainter:
    """Draws the person of a shot over a picture of the room."""

    def __init__(self, body: Body, shot: TalkShot, room: NDArray[np.uint8]) -> None:
        self._body = body
        self._shot = shot
        self._room = room.astype(float)
        self._triangles = body.triangles()
        self._colors = _colors(body)
        self._edges = np.concatenate([body.faces[:, [k, (k + 1) % 4]] for k in range(4)])

    def picture(self, frame: int) -> NDArray[np.uint8]:
        """Draw a frame, (H, W, 3) uint8 RGB."""
        V = self._shot.to_camera(self._shot.vertices_world(self._body, frame))
        width, height = self._shot.size
        K = np.diag([_OVER, _OVER, 1.0]) @ self._shot.intrinsics
        K[:2, 2] += (_OVER - 1) / 2
        canvas = Canvas.blank(_OVER * width, _OVER * height)
        rasterize(canvas, V, self._triangles, self._colors, K, shading=self._shading(V))
        coverage = cv2.resize(
            canvas.coverage.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA
        )
        drawn = canvas.rgba[..., :3] * canvas.coverage[..., None].astype(np.float32)
        image = cv2.resize(drawn, (width, height), interpolation=cv2.INTER_AREA)
        image = image + self._room * (1.0 - coverage[..., None])
        return np.clip(np.round(image), 0, 255).astype(np.uint8)

    def _shading(self, V: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return brightness and rim light (V, 2) by two lamps, darker in hollows."""
        normals = vertex_normals(np.ascontiguousarray(V), self._triangles)
        hollow = hollows(V, normals, self._edges)
        directions = _LIGHTS / np.linalg.norm(_LIGHTS, axis=1, keepdims=True)
        light = _AMBIENT + np.maximum(normals @ directions.T, 0) @ _STRENGTH
        light *= np.clip(1.0 - hollow / _CONCAVE, 0.45, 1.1)
        return np.stack([np.clip(light, 0, 1.15), np.zeros(len(V))], axis=1)


def draw_clip(
    body: Body, shot: TalkShot, room: NDArray[np.uint8], path: Path, temporary: Path
) -> None:
    """Write the shot to an .mp4 file.

    :param room: (H, W, 3) RGB.
    :param temporary: what is written, to be renamed to ``path``.
    :raises OutputError: the file cannot be written.
    """
    painter = PersonPainter(body, shot, room)
    with VideoWriter(temporary, Fraction(round(shot.fps)), *shot.size, path) as writer:
        for frame in range(len(shot)):
            writer.write(painter.picture(frame))


def _colors(body: Body) -> NDArray[np.float32]:
    """Return the colour (F', 3) of each triangle, sRGB 0..1."""
    assert body.face_material is not None  # the built-in bodies have materials
    assert body.material_colors is not None
    look = draw_look(body, np.random.default_rng(_LOOK))
    names = list(body.material_names)
    colors = np.asarray(body.material_colors)[body.face_material, :3].astype(float)
    skin = body.face_material == names.index("skin")
    colors[skin] = look.skin[body.faces[skin]].mean(axis=1)
    colors[body.face_material == names.index("eye_iris")] = look.iris
    colors[body.face_material == names.index("hair")] = HAIR
    colors[mouth_faces_of(body)] = 0.12 * look.skin.min(axis=0)
    srgb: NDArray[np.float32] = np.tile(np.clip(colors, 0, 1) ** (1 / 2.2), (2, 1)).astype(
        np.float32
    )
    return srgb
