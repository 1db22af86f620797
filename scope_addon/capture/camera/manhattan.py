# SPDX-License-Identifier: GPL-3.0-or-later
"""The three directions at right angles of what people build: up u, and two level ones h and u × h.

Edges along a direction d in space point, in the picture, at d's vanishing point f d_xy / d_z (from the middle). Three
directions explain an edge i if one of the three points lies along it, within an angle ∠_i at the edge's middle:

    score(f) = max over u, h of Σ_i w_i max_d exp(−sin² ∠_i / 2 s²)

w_i the edge's length in sides of the picture. Angles are those in the picture, since those between planes through the
camera's centre shrink when f grows. Where f is known, such planes are simpler (`line_normal_equations`): with unit normals n_i,
edges along d have n_i·d = 0.

Source: Coughlan and Yuille 2003.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .line_segments import Lines, Segments, plane_normals

LARGEST_TILT = np.radians(25.0)  # between the picture's up and what edges may say
NEARLY = np.radians(0.8)  # by which an edge's plane may miss a direction that it has
EDGE_SIGMA = np.radians(1.0)
MOST_EDGES = 120
CANDIDATES = 60  # edges of which each may be level, the longest ones
UPRIGHTS = 16  # directions that may be up, the best by the edges
UPRIGHTS_APART = np.radians(0.7)
_BLOCK = 256
_TILTS = np.arange(-LARGEST_TILT, LARGEST_TILT + 1e-9, np.radians(1.0))
_TILTED = np.stack([np.zeros_like(_TILTS), -np.cos(_TILTS), np.sin(_TILTS)], axis=1)  # of a camera that is not rolled


@dataclass(frozen=True)
class Edges:
    """The longest edges of a picture."""

    ends: np.ndarray  # (N, 2, 2) pixels from the picture's middle
    middle: np.ndarray  # (N, 2)
    along: np.ndarray  # (N, 2) unit
    weight: np.ndarray  # (N,)

    @classmethod
    def of(cls, segments: Segments, width: int, height: int) -> Edges:
        """Of a picture of this size."""
        ends = (segments.ends_px[:MOST_EDGES] - [width / 2, height / 2]).astype(np.float32)
        along = ends[:, 1] - ends[:, 0]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        return cls(ends, ends.mean(axis=1), along, segments.lengths[:MOST_EDGES].astype(np.float32))

    def axes(self, focal_px: float) -> tuple[float, np.ndarray]:
        """Sides of the picture that the best three directions explain; these, (3, 3) rows u, h, u × h, camera frame."""
        normals = self._normals(focal_px)
        return self._best(self._uprights(normals, focal_px), normals, focal_px)

    def support(self, focal_px: float) -> float:
        """Sides of the picture that the best three directions explain, whether any edge is upright or not.

        With a focal length at which no two edges meet upright, the level ones alone may be explained as well as with
        another at which two happen to meet: by a camera that is only tilted.
        """
        normals = self._normals(focal_px)
        return self._best(self._uprights(normals, focal_px) or list(_TILTED), normals, focal_px)[0]

    def _normals(self, focal_px: float) -> np.ndarray:
        """(N, 3) of the planes through the camera's centre."""
        return plane_normals(np.concatenate([self.ends, np.full((*self.ends.shape[:2], 1), focal_px, np.float32)], -1))

    def _best(self, uprights: list[np.ndarray], normals: np.ndarray, focal_px: float) -> tuple[float, np.ndarray]:
        """As `axes`, of those with one of these directions up."""
        score, axes = 0.0, np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        for up in uprights:
            level = np.cross(normals[:CANDIDATES], up)  # along the edge, if it is level
            size = np.linalg.norm(level, axis=1)
            level = level[size > 0.1] / size[size > 0.1, None]
            if not len(level):
                continue
            explained = np.maximum(self._explained(level, focal_px), self._explained(np.cross(up, level), focal_px))
            explained = np.maximum(explained, self._explained(up[None], focal_px)) @ self.weight
            best = int(explained.argmax())
            if explained[best] > score:
                score, axes = float(explained[best]), np.array([up, level[best], np.cross(up, level[best])], float)
        return score, axes

    def _uprights(self, normals: np.ndarray, focal_px: float) -> list[np.ndarray]:
        """Directions near the picture's up in which pairs of edges meet, the best ones, all different."""
        up = np.array([0.0, -1.0, 0.0])
        found = meeting_directions(normals[may_be_upright(normals, up)], up)
        if not len(found):
            return []
        parts = np.array_split(found, len(found) // _BLOCK + 1)
        score = np.concatenate([self._explained(part, focal_px) @ self.weight for part in parts])
        chosen: list[np.ndarray] = []
        for candidate in found[np.argsort(-score)]:
            if all(candidate @ other < np.cos(UPRIGHTS_APART) for other in chosen):
                chosen.append(candidate)
            if len(chosen) == UPRIGHTS:
                break
        return chosen

    def _explained(self, directions: np.ndarray, focal_px: float) -> np.ndarray:
        """(n, N) how well each edge points at the vanishing point of directions (n, 3): 1 exactly."""
        d = directions.astype(np.float32)
        x, y = (np.float32(focal_px) * d[:, k, None] - d[:, 2, None] * self.middle[:, k] for k in (0, 1))
        across = x * self.along[:, 1] - y * self.along[:, 0]
        sine2 = across * across / np.maximum(x * x + y * y, np.float32(1e-12))
        return np.exp(np.float32(-0.5 / EDGE_SIGMA**2) * sine2)


def may_be_upright(normals: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(N,) whether lines with these normals (N, 3) can run along a direction near ``up``."""
    return np.abs(normals @ up) < np.sin(LARGEST_TILT + NEARLY)


def meeting_directions(normals: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(n, 3) the directions near ``up`` in which pairs of lines with these normals (N, 3) meet."""
    i, j = np.triu_indices(len(normals), 1)
    v = np.cross(normals[i], normals[j])
    size = np.linalg.norm(v, axis=1)
    v = v[size > 0.02] / size[size > 0.02, None]
    v *= np.where(v @ up < 0, -1.0, 1.0)[:, None]
    return v[v @ up > np.cos(LARGEST_TILT)]


def line_normal_equations(
    lines: Lines, directions: np.ndarray, sigma: float, worth: np.ndarray | float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What lines ask of a small turn ω of three directions, each line of the direction that is nearest to it.

    With r_i = min_d n_i·d and J_i = d × n_i, the Gauss-Newton step of max Σ_i v_d w_i exp(−r_i² / 2σ²) is ω = H⁻¹ g:
    H = Σ_i ρ_i J_i J_iᵀ and g = −Σ_i ρ_i r_i J_i with ρ_i = v_d w_i exp(−r_i² / 2σ²).

    :param directions: (3, 3) unit rows;  worth: v, of each direction (3,) or of all.
    :return: H (3, 3), g (3,), and (3,) how much each direction explains, Σ w_i exp(−r_i² / 2σ²), in sides.
    """
    off = lines.normals @ directions.T
    nearest = np.abs(off).argmin(axis=1)
    residual = off[np.arange(len(off)), nearest]
    explained = lines.lengths * np.exp(-0.5 * np.square(residual / sigma))
    weight = explained * np.broadcast_to(worth, 3)[nearest]
    J = np.cross(directions[nearest], lines.normals)
    return (weight[:, None] * J).T @ J, -(weight * residual) @ J, np.bincount(nearest, explained, minlength=3)
