# SPDX-License-Identifier: GPL-3.0-or-later
"""A fast renderer of the head, without shadows, for the many pictures that something is calibrated
on.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.fitting.rasterizer import Canvas, rasterize, vertex_normals
from ...scope_addon.kinematics.face import mouth_faces_of
from ...solver.body import Body
from .looks import Look
from .truth import SIZE, head_faces
from .worn import WORN

_OVER = 2  # pixels are drawn so many times finer
_CONCAVE = 300.0  # per metre: how much darker hollows are


class ShadedStage:
    """Draws one head; the same interface as `Stage`."""

    def __init__(self, body: Body) -> None:
        kept = head_faces(body)
        assert body.face_material is not None  # checked by `head_faces`
        quads = body.faces[kept]
        self._triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(
            np.int32
        )
        self._material = body.face_material[kept]
        self._names = list(body.material_names)
        self._palette = np.asarray(body.material_colors)[:, :3]
        self._mouth = np.isin(np.flatnonzero(kept), mouth_faces_of(body))
        self._worn: dict[str, tuple[NDArray[np.int32], NDArray[np.float32]]] = {}
        self._quads = quads
        self._edges = np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)])

    def dress(self, look: Look, rng: np.random.Generator) -> None:
        """Take a person's colours, and draw light and background."""
        colors = self._palette[self._material].copy()
        skin = np.isin(
            self._material, [self._names.index(n) for n in ("skin", "suit", "suit_accent")]
        )
        colors[skin] = look.skin[self._quads[skin]].mean(axis=1)
        colors[self._material == self._names.index("hair")] = look.hair
        colors[self._material == self._names.index("eye_iris")] = look.iris
        colors[self._mouth] = 0.1 * look.skin.min(axis=0)
        self._colors = np.tile(np.clip(colors, 0, 1) ** (1 / 2.2), (2, 1)).astype(np.float32)
        directions = rng.normal(size=(2, 3)) * [1.0, 0.7, 0.4] + [0, -0.5, -1.0]
        self._lights = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        self._strength = np.array([rng.uniform(0.35, 0.9), rng.uniform(0, 0.3)])
        self._ambient = rng.uniform(0.35, 0.65)
        self._background = rng.uniform(60, 220, 3)
        self._noise = np.random.default_rng(rng.integers(1 << 30))
        self._hair = look.hair

    def wear(self, things: dict[str, list[tuple[int, ...]]]) -> None:
        """Put on things, by the names of `WORN`, with these faces; what was worn is taken off."""
        self._worn = {}
        for name, faces in things.items():
            color, stopped = WORN[name][:2]
            if stopped < 1.0:
                continue  # clear lenses: reflections are not drawn
            triangles = np.array(
                [(f[0], f[k], f[k + 1]) for f in faces for k in range(1, len(f) - 1)], np.int32
            )
            srgb = np.clip(self._hair if name == "beard" else color, 0, 1) ** (1 / 2.2)
            both = np.concatenate([triangles, triangles[:, ::-1]])  # hairs are seen from both sides
            self._worn[name] = both, np.tile(srgb, (len(both), 1)).astype(np.float32)

    def render(
        self,
        vertices_camera: NDArray[np.float64],
        focal_px: float,
        path: Path,
        worn: dict[str, NDArray[np.float64]] | None = None,
    ) -> None:
        """Render a picture of SIZE × SIZE pixels.

        :param vertices_camera: (V, 3) of the body, metres in the camera frame.
        :param worn: vertices (N, 3) of what is worn, likewise.
        """
        V = np.ascontiguousarray(vertices_camera, float)
        normals = vertex_normals(V, self._triangles)
        hollow = hollows(V, normals, self._edges)
        light = self._ambient + np.maximum(normals @ self._lights.T, 0) @ self._strength
        light *= np.clip(1.0 - hollow / _CONCAVE * 3.0, 0.25, 1.1)
        shading = np.stack([np.clip(light, 0, 1.3), np.zeros(len(V))], axis=1)
        side = _OVER * SIZE
        K = np.array(
            [
                [focal_px * _OVER, 0, side / 2 - 0.5],
                [0, focal_px * _OVER, side / 2 - 0.5],
                [0, 0, 1.0],
            ]
        )
        canvas = Canvas.blank(side, side)
        rasterize(canvas, V, self._triangles, self._colors, K, shading=shading)
        for name, (triangles, colors) in self._worn.items():
            places = np.ascontiguousarray((worn or {})[name], float)
            rasterize(
                canvas, places, triangles, colors, K, shading=np.tile([0.9, 0.0], (len(places), 1))
            )
        image = np.where(canvas.coverage[..., None], canvas.rgba[..., :3], self._background)
        image = cv2.resize(
            cv2.GaussianBlur(image, (0, 0), 1.2), (SIZE, SIZE), interpolation=cv2.INTER_AREA
        )
        noisy = image + self._noise.normal(0, 2.5, image.shape)
        cv2.imwrite(str(path), np.clip(noisy, 0, 255).astype(np.uint8)[..., ::-1])


def hollows(
    vertices: NDArray[np.float64], normals: NDArray[np.float64], edges: NDArray[np.integer[Any]]
) -> NDArray[np.float64]:
    """Return how much the surface curves towards its outside at each vertex (V,), per metre.

    :param vertices: (V, 3) metres.
    :param normals: (V, 3).
    :param edges: (E, 2) from a vertex to another.
    """
    a, b = edges.T
    step = vertices[b] - vertices[a]
    count = len(vertices)
    rise = np.bincount(a, np.einsum("ex,ex->e", step, normals[a]), count)
    out: NDArray[np.float64] = rise / np.maximum(
        np.bincount(a, np.linalg.norm(step, axis=1) ** 2, count), 1e-12
    )
    return out
