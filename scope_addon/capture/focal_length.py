# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length by the edges of what people build: most are upright or level, at right angles to each other.

Edges along a direction d in space point, in the picture, at d's vanishing point f d_xy / d_z (from the middle). Three
directions at right angles, up u and two level ones h and u × h, explain an edge i if one of the three points lies
along it, within an angle ∠_i at the edge's middle. Which of them do so depends on f:

    score(f) = max over u, h of Σ_i w_i max_d exp(−sin² ∠_i / 2 s²),   p(f) ∝ exp(κ score(f)) N(log f; log f_0, σ²)

w_i the edge's length in sides of the picture, f_0 and σ what is assumed without looking. Angles are those in the
picture, since those between planes through the camera's centre shrink when f grows. A wall seen straight on fits every
f; then p stays as wide as what was assumed, and nothing is said.

Sources: Caprile and Torre 1990 (f from vanishing points), Coughlan and Yuille 2003 (three directions at right angles).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .camera import ASSUMED_DEVIATION
from .line_segments import Segments
from .vertical_lines import may_be_upright, meeting_directions

EDGE_SIGMA = np.radians(1.0)
KAPPA = 4.0
MOST_EDGES = 120
CANDIDATES = 60  # edges of which each may be level, the longest ones
UPRIGHTS = 16  # directions that may be up, the best by the edges
UPRIGHTS_APART = np.radians(0.7)
LOG_RANGE, COARSE_STEP, FINE_STEP = 0.7, 0.05, 0.0125  # of log(f / f_0)
CERTAIN = 0.1  # deviation of log f: whatever is less certain is no better than what was assumed
_BLOCK = 256


@dataclass(frozen=True)
class FocalLength:
    """Mean, and standard deviation of its logarithm: the relative error."""

    focal_px: float
    deviation: float


def focal_from_edges(segments: Segments, width: int, height: int, assumed_px: float) -> FocalLength | None:
    """The focal length that a picture's edges tell; None where they do not tell any."""
    edges = _Edges.of(segments, width, height)
    coarse = np.arange(-LOG_RANGE, LOG_RANGE + 1e-9, COARSE_STEP)
    scores = [edges.score(assumed_px * np.exp(x)) for x in coarse]
    best = float(coarse[_log_posterior(coarse, scores).argmax()])
    fine = np.arange(best - COARSE_STEP, best + COARSE_STEP + 1e-9, FINE_STEP)
    log_ratio = np.concatenate([coarse[np.abs(coarse - best) > COARSE_STEP + 1e-6], fine])
    known = dict(zip(coarse.tolist(), scores, strict=True))
    scores = [known.get(x) or edges.score(assumed_px * np.exp(x)) for x in log_ratio.tolist()]
    mean, deviation = _moments(log_ratio, scores)
    return FocalLength(assumed_px * float(np.exp(mean)), deviation) if deviation < CERTAIN else None


def _log_posterior(log_ratio: np.ndarray, scores: list[float]) -> np.ndarray:
    return KAPPA * np.array(scores) - 0.5 * np.square(log_ratio / ASSUMED_DEVIATION)


def _moments(log_ratio: np.ndarray, scores: list[float]) -> tuple[float, float]:
    """Mean and standard deviation of log(f / f_0), by trapezoids over unevenly spaced values."""
    order = np.argsort(log_ratio)
    x, log_p = log_ratio[order], _log_posterior(log_ratio, scores)[order]
    p = np.exp(log_p - log_p.max()) * np.gradient(x)
    p /= p.sum()
    mean = float(p @ x)
    return mean, float(np.sqrt(p @ np.square(x - mean)))


@dataclass(frozen=True)
class _Edges:
    ends: np.ndarray  # (N, 2, 2) pixels from the picture's middle
    middle: np.ndarray  # (N, 2)
    along: np.ndarray  # (N, 2) unit
    weight: np.ndarray  # (N,)

    @classmethod
    def of(cls, segments: Segments, width: int, height: int) -> _Edges:
        ends = (segments.ends_px[:MOST_EDGES] - [width / 2, height / 2]).astype(np.float32)
        along = ends[:, 1] - ends[:, 0]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        return cls(ends, ends.mean(axis=1), along, segments.lengths[:MOST_EDGES].astype(np.float32))

    def score(self, focal_px: float) -> float:
        """Sides of the picture that the best three directions explain."""
        rays = np.concatenate([self.ends, np.full((*self.ends.shape[:2], 1), focal_px, np.float32)], axis=-1)
        normals = np.cross(rays[:, 0], rays[:, 1])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        best = 0.0
        for up in self._uprights(normals, focal_px):
            level = np.cross(normals[:CANDIDATES], up)  # along the edge, if it is level
            size = np.linalg.norm(level, axis=1)
            level = level[size > 0.1] / size[size > 0.1, None]
            if not len(level):
                continue
            explained = np.maximum(self._explained(level, focal_px), self._explained(np.cross(up, level), focal_px))
            explained = np.maximum(explained, self._explained(up[None], focal_px))
            best = max(best, float((explained @ self.weight).max()))
        return best

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
