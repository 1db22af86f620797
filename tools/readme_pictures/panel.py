# SPDX-License-Identifier: GPL-3.0-or-later
"""One panel of a picture: background, floor grid, shadows, bodies, stick figures, measures and a
heading.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.fitting.rasterizer import Canvas, rasterize
from ...scope_addon.capture.overlay_video import draw_overlay
from ...solver import Body
from .shapes import stick_figure
from .view import View

FINER = 3  # supersampling: everything is drawn larger by this factor and scaled down at the end
GROUND = (246, 247, 249)
GRID = (203, 208, 215)
INK = (52, 58, 66)
Color = tuple[float, ...]  # RGB: 0..1 of bodies and sticks, 0..255 of lines and text
OURS = (0.42, 0.62, 0.90)
TRUTH = (0.88, 0.22, 0.16)
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_HIDDEN = 0.55  # opacity of a stick behind the body
# spacing and half width of the grid, metres
_STEP = 0.5
_REACH = 5.0


class Panel:
    """A picture that is being drawn. Points are in metres in the view's world; the floor is z =
    0.
    """

    def __init__(self, view: View, middle: NDArray[np.float64]) -> None:
        scale = np.diag([FINER, FINER, 1.0])
        width, height = view.size
        self.view = View(
            scale @ view.intrinsics, view.world_from_camera, (FINER * width, FINER * height)
        )
        self.image = np.full((FINER * height, FINER * width, 3), GROUND, np.uint8)
        self._depth = np.full(self.image.shape[:2], np.inf, np.float32)
        self._grid(middle)

    def body(
        self, body: Body, vertices: NDArray[np.float64], color: Color | NDArray[np.float64] = OURS
    ) -> None:
        """Draw a body, of one colour or with one (F, 3) for each face, and its shadow under a light
        from above.
        """
        triangles = np.concatenate([body.faces[:, [0, 1, 2]], body.faces[:, [0, 2, 3]]])
        self._shadow(vertices, triangles)
        seen = self.view.to_camera(vertices)
        colors = np.array(color) if np.ndim(color) == 1 else np.tile(color, (2, 1))
        self.image = draw_overlay(
            self.image, [seen], triangles, self.view.intrinsics, None, [colors], [1.0]
        )
        self._depth = np.minimum(self._depth, self._rasterized(seen, triangles, OURS).depth)

    def sticks(
        self, points: dict[str, NDArray[np.float64]], color: Color = TRUTH, radius: float = 0.014
    ) -> None:
        """Draw a stick figure; parts within or behind a body show through it."""
        vertices, triangles = stick_figure(points, radius)
        canvas = self._rasterized(self.view.to_camera(vertices), triangles, color)
        drawn = np.where(canvas.depth < self._depth, 1.0, _HIDDEN) * canvas.coverage.astype(float)
        alpha = cv2.blur(drawn, (3, 3))[..., None]
        mixed = self.image * (1 - alpha) + cv2.blur(canvas.rgba[..., :3], (3, 3)) * alpha
        self.image = (mixed + 0.5).astype(np.uint8)

    def line(
        self,
        a: NDArray[np.float64],
        b: NDArray[np.float64],
        color: Color = INK,
        dashed: bool = False,
        width: float = 1.2,
    ) -> None:
        """Draw a line between two points, over everything."""
        count = 41 if dashed else 2
        points = self.view.project(np.linspace(a, b, count))
        for k in range(0, count - 1, 2):
            self._stroke(points[k], points[k + 1], color, width)

    def note(
        self, text: str, at: NDArray[np.float64], offset: tuple[float, float], size: float = 0.46
    ) -> None:
        """Label a point at ``offset`` pixels of the finished picture from it, with a thin leader
        line.
        """
        point = self.view.project(at)
        place = point + FINER * np.array(offset)
        (width, _), _ = cv2.getTextSize(text, _FONT, FINER * size, FINER)
        self._stroke(point, place, INK, 0.8)
        cv2.circle(self.image, _pixel(point), round(2.2 * FINER), INK, -1, cv2.LINE_AA)
        left = place[0] + (FINER * 4 if offset[0] >= 0 else -width - FINER * 4)
        self._write(text, np.array([left, place[1] + FINER * 5]), size)

    def heading(self, text: str) -> None:
        """Write a heading into the upper left corner."""
        self._write(text, FINER * np.array([12.0, 24.0]), 0.5)

    def legend(self, entries: Sequence[tuple[str, Color]]) -> None:
        """Draw a legend of colours in the lower left corner."""
        left = FINER * 12
        top = self.image.shape[0] - FINER * 12
        for text, color in entries:
            rgb = tuple(int(255 * c) for c in color)
            cv2.rectangle(self.image, (left, top - FINER * 10), (left + FINER * 10, top), rgb, -1)
            self._write(text, np.array([left + FINER * 16.0, top]), 0.44)
            left += FINER * 28 + cv2.getTextSize(text, _FONT, FINER * 0.44, FINER)[0][0]

    def finished(self) -> NDArray[np.uint8]:
        """Return the picture, (H, W, 3) RGB."""
        small = cv2.resize(
            self.image, None, fx=1 / FINER, fy=1 / FINER, interpolation=cv2.INTER_AREA
        )
        return small.astype(np.uint8, copy=False)

    def _grid(self, middle: NDArray[np.float64]) -> None:
        """Draw lines on the floor that fade with their distance from the middle."""
        center = np.round(np.asarray(middle)[:2] / _STEP) * _STEP
        across = np.arange(-_REACH, _REACH + 1e-6, _STEP)
        along = np.linspace(-_REACH, _REACH, 101)
        for axis in (0, 1):
            for offset in across:
                points = np.zeros((len(along), 3))
                points[:, axis] = along
                points[:, 1 - axis] = offset
                points[:, :2] += center
                pixels = self.view.project(points)
                fade = np.clip(
                    1.3 - np.linalg.norm(points[:, :2] - middle[:2], axis=1) / _REACH * 1.3, 0, 1
                )
                for k in range(len(along) - 1):
                    color = fade[k] * np.array(GRID) + (1 - fade[k]) * np.array(GROUND)
                    self._stroke(pixels[k], pixels[k + 1], tuple(color), 1.0)

    def _shadow(self, vertices: NDArray[np.float64], triangles: NDArray[np.intp]) -> None:
        flat = vertices * [1, 1, 0]
        both = np.concatenate([triangles, triangles[:, ::-1]])
        covered = self._rasterized(self.view.to_camera(flat), both, (0.0, 0.0, 0.0)).coverage
        covered &= ~np.isfinite(self._depth)  # hidden by a body
        soft = cv2.GaussianBlur(covered.astype(np.float32), (0, 0), 3.0 * FINER)[..., None]
        self.image = (self.image * (1 - 0.28 * soft) + 0.5).astype(np.uint8)

    def _rasterized(
        self, points_camera: NDArray[np.float64], triangles: NDArray[np.intp], color: Color
    ) -> Canvas:
        canvas = Canvas.blank(*self.view.size)
        rasterize(
            canvas, points_camera, triangles, np.array(color, np.float32), self.view.intrinsics
        )
        return canvas

    def _stroke(
        self, a: NDArray[np.float64], b: NDArray[np.float64], color: Color, width: float
    ) -> None:
        if np.isfinite([a, b]).all() and np.abs([a, b]).max() < 1e5:
            cv2.line(
                self.image, _pixel(a), _pixel(b), color, max(1, round(width * FINER)), cv2.LINE_AA
            )

    def _write(self, text: str, at: NDArray[Any], size: float) -> None:
        cv2.putText(
            self.image, text, _pixel(at), _FONT, FINER * size, GROUND, 5 * FINER, cv2.LINE_AA
        )
        cv2.putText(
            self.image, text, _pixel(at), _FONT, FINER * size, INK, round(1.4 * FINER), cv2.LINE_AA
        )


def _pixel(at: NDArray[np.float64]) -> tuple[int, int]:
    return round(float(at[0])), round(float(at[1]))


def next_to_each_other(panels: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Join panels of one height in a row, with a white line between them."""
    line = np.full((len(panels[0]), 2, 3), 255, np.uint8)
    return np.concatenate([part for panel in panels for part in (panel, line)][:-1], axis=1)
