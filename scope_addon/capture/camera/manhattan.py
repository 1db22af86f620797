# SPDX-License-Identifier: GPL-3.0-or-later
"""Manhattan directions, the three orthogonal directions of buildings: up u, and two horizontal ones
h and u × h.

In the picture, edges along a direction d of space point at d's vanishing point f d_xy / d_z
(relative to the middle). Three directions explain an edge i if it points at one of the three
vanishing points, within an angle ∠_i at the edge's middle:

    score(f) = max over u, h of Σ_i w_i max_d exp(−sin² ∠_i / 2 s²)

with w_i the edge's length in sides of the picture. Angles are measured in the picture, because
those between planes through the camera's centre shrink when f grows. If f is known, such planes are
simpler (`line_normal_equations`): with unit normals n_i, edges along d satisfy n_i·d = 0.

Source: Coughlan and Yuille 2003.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Float32Array, Float64Array, unit_vectors
from .line_segments import Lines, Segments, plane_normals

MAX_TILT = np.radians(25.0)  # between the picture's vertical and the direction of vertical edges
PLANE_SIGMA = np.radians(0.8)  # between an edge's plane and its direction
EDGE_SIGMA = np.radians(1.0)
MAX_EDGES = 120
HORIZONTAL_CANDIDATES = 60  # edges, the longest ones, each of which may be horizontal
UP_CANDIDATES = 16  # directions that may be up, those with most support
MIN_CANDIDATE_ANGLE = np.radians(0.7)  # between two of them
_BLOCK = 64  # directions that are tried at once
_TILTS = np.arange(-MAX_TILT, MAX_TILT + 1e-9, np.radians(1.0))
# Directions of up for a camera without roll.
_TILTED = np.stack([np.zeros_like(_TILTS), -np.cos(_TILTS), np.sin(_TILTS)], axis=1)


@dataclass(frozen=True)
class Edges:
    """The longest edges of a picture."""

    ends: Float32Array  # (N, 2, 2) pixels, relative to the picture's middle
    middle: Float32Array  # (N, 2)
    along: Float32Array  # (N, 2) unit vectors
    weight: Float32Array  # (N,) lengths in sides of the picture

    @classmethod
    def of(cls, segments: Segments, width: int, height: int) -> Edges:
        """Select the longest segments of a picture of this size in pixels."""
        ends = (segments.ends_px[:MAX_EDGES] - [width / 2, height / 2]).astype(np.float32)
        along = unit_vectors(ends[:, 1] - ends[:, 0])
        return cls(ends, ends.mean(axis=1), along, segments.lengths[:MAX_EDGES].astype(np.float32))

    def axes(self, focal_px: float) -> tuple[float, Float64Array]:
        """Find the three directions that explain most of the edges.

        :return: the sides of the picture that they explain; their (3, 3) rows u, h, u × h, in
            camera axes.
        """
        normals = self._normals(focal_px)
        equations = self._equations(focal_px)
        return self._best(self._up_candidates(normals, equations), normals, equations)

    def support(self, focal_px: float) -> float:
        """Return the sides of the picture that the best three directions explain, with or without
        vertical edges.

        At a focal length for which no two vertical edges intersect, the horizontal ones alone may
        be explained as well as at another focal length for which two happen to: by a camera with
        tilt and no roll.
        """
        normals = self._normals(focal_px)
        equations = self._equations(focal_px)
        return self._best(
            self._up_candidates(normals, equations) or list(_TILTED), normals, equations
        )[0]

    def _normals(self, focal_px: float) -> NDArray[Any]:
        """Return the (N, 3) normals of the planes through the camera's centre and the edges."""
        return plane_normals(
            np.concatenate(
                [self.ends, np.full((*self.ends.shape[:2], 1), focal_px, np.float32)], -1
            )
        )

    def _best(
        self, candidates: Sequence[NDArray[Any]], normals: NDArray[Any], equations: Float32Array
    ) -> tuple[float, Float64Array]:
        """Return what `axes` does, where one of the candidates is up."""
        ups = np.asarray(candidates).reshape(-1, 3)
        # Directions along the edges, if these are horizontal.
        level = np.cross(normals[None, :HORIZONTAL_CANDIDATES], ups[:, None])
        size = np.linalg.norm(level, axis=2)
        which, _ = np.nonzero(size > 0.1)
        if not len(which):
            return 0.0, np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        level = level[size > 0.1] / size[size > 0.1, None]
        across = np.cross(ups[which], level)
        up_sine2 = _sine2(ups, equations)
        explained = []
        for k in range(0, len(level), _BLOCK):
            sine2 = _sine2(level[k : k + _BLOCK], equations)
            np.minimum(sine2, _sine2(across[k : k + _BLOCK], equations), out=sine2)
            np.minimum(sine2, up_sine2[which[k : k + _BLOCK]], out=sine2)
            explained.append(_explained(sine2) @ self.weight)
        score = np.concatenate(explained)
        best = int(score.argmax())
        return float(score[best]), np.array([ups[which[best]], level[best], across[best]], float)

    def _up_candidates(self, normals: NDArray[Any], equations: Float32Array) -> list[NDArray[Any]]:
        """Return distinct directions near the picture's vertical in which pairs of edges intersect,
        the best first.
        """
        up = np.array([0.0, -1.0, 0.0])
        may_be_vertical = np.abs(normals @ up) < np.sin(MAX_TILT + PLANE_SIGMA)
        found = intersection_directions(normals[may_be_vertical], up)
        if not len(found):
            return []
        blocks = np.array_split(found, len(found) // _BLOCK + 1)
        score = np.concatenate(
            [_explained(_sine2(block, equations)) @ self.weight for block in blocks]
        )
        rest = found[np.argsort(-score, kind="stable")]
        chosen = list[NDArray[Any]]()
        while len(rest) and len(chosen) < UP_CANDIDATES:
            chosen.append(rest[0])
            rest = rest[rest @ rest[0] < np.cos(MIN_CANDIDATE_ANGLE)]
        return chosen

    def _equations(self, focal_px: float) -> Float32Array:
        """Return (3, 3 N): a direction d times it is, for each edge, f d_xy − d_z m and its
        component across the edge.

        With m the edge's middle, that is the vector from there to the vanishing point, times d_z:
        x, y, and across.
        """
        f = np.full_like(self.weight, focal_px)
        zero = np.zeros_like(self.weight)
        to_x = np.stack([f, zero, -self.middle[:, 0]])
        to_y = np.stack([zero, f, -self.middle[:, 1]])
        return np.concatenate(
            [to_x, to_y, to_x * self.along[:, 1] - to_y * self.along[:, 0]], axis=1
        )


def _sine2(directions: NDArray[Any], equations: Float32Array) -> NDArray[Any]:
    """Return (n, N) sin² of the angles between each edge and the vanishing points of directions (n,
    3).
    """
    squares = directions.astype(np.float32) @ equations
    squares *= squares
    x2, y2, across2 = np.split(squares, 3, axis=1)
    x2 += y2
    return across2 / np.maximum(x2, np.float32(1e-12), out=x2)


def _explained(sine2: NDArray[Any]) -> NDArray[Any]:
    """Turn sin² of angles between edges and vanishing points into how well the edges point at them;
    1: exactly.
    """
    sine2 *= np.float32(-0.5 / EDGE_SIGMA**2)
    return np.exp(sine2, out=sine2)


def intersection_directions(normals: NDArray[Any], up: Float64Array) -> NDArray[Any]:
    """Return the (n, 3) directions near ``up`` (3,) in which pairs of lines with these normals (N,
    3) intersect.
    """
    i, j = np.triu_indices(len(normals), 1)
    v = np.cross(normals[i], normals[j])
    size = np.linalg.norm(v, axis=1)
    v = v[size > 0.02] / size[size > 0.02, None]
    v *= np.where(v @ up < 0, -1.0, 1.0)[:, None]
    return v[v @ up > np.cos(MAX_TILT)]


def line_normal_equations(
    lines: Lines, directions: Float64Array, sigma: float, value: Float64Array | float = 1.0
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Compute the normal equations of a small rotation ω of three directions, each line assigned to
    the nearest one.

    With r_i = min_d n_i·d and J_i = d × n_i, the Gauss-Newton step of max Σ_i v_d w_i exp(−r_i² /
    2σ²) is ω = H⁻¹ g: H = Σ_i ρ_i J_i J_iᵀ and g = −Σ_i ρ_i r_i J_i with ρ_i = v_d w_i exp(−r_i² /
    2σ²).

    :param directions: (..., 3, 3) unit rows, in the lines' axes.
    :param sigma: σ in radians.
    :param value: v of each direction (3,), or of all.
    :return: H (..., 3, 3), g (..., 3), and (..., 3) how much each direction explains, Σ w_i
        exp(−r_i² / 2σ²), in sides.
    """
    off = lines.normals @ directions.swapaxes(-1, -2)
    nearest = np.abs(off).argmin(axis=-1)
    residual = np.take_along_axis(off, nearest[..., None], -1)[..., 0]
    explained = lines.lengths * np.exp(-0.5 * np.square(residual / sigma))
    weight = explained * np.broadcast_to(value, 3)[nearest]
    J = np.cross(np.take_along_axis(directions, nearest[..., None], -2), lines.normals)
    g: Float64Array = -((weight * residual)[..., None, :] @ J)[..., 0, :]
    supports = np.where(nearest[..., None] == np.arange(3), explained[..., None], 0.0).sum(axis=-2)
    return (weight[..., None] * J).swapaxes(-1, -2) @ J, g, supports
