# SPDX-License-Identifier: GPL-3.0-or-later
"""Which way is up by the edges of what people build: walls, doors, posts, which meet at the vertical vanishing point.

A line in the picture and the camera's centre span a plane with unit normal n; an edge along direction v has n·v = 0.
With u what the body says is up, v maximizes over unit vectors

    −∠(v, u)² / 2σ² + κ Σ_i w_i exp(−∠_i² / 2s²),   sin ∠_i = n_i·v,

w_i the line's length in sides of the picture. The sum's best directions are those of pairs of lines; of these the best
one is refined. Where too little that is upright is to be seen, nothing is said.

Source: vanishing points by Barnard 1983.
"""

from __future__ import annotations

import numpy as np

from .line_segments import Lines

LARGEST_TILT = np.radians(25.0)  # between what the body, or the picture, says and what lines may say
BODY_SIGMA = np.radians(10.0)
LINE_SIGMA = np.radians(0.8)
KAPPA = 4.0
LEAST_SUPPORT = 0.4  # sides of the picture, all upright lines together: less may be chance


def up_from_lines(lines: Lines, up: np.ndarray) -> np.ndarray | None:
    """(3,) the upright direction that lines say, near ``up``, what the body says; None where they do not say any."""
    near = may_be_upright(lines.normals, up)
    normals, lengths = lines.normals[near], lines.lengths[near]
    v = meeting_directions(normals, up)
    if not len(v):
        return None
    parts = np.array_split(v, len(v) // 500 + 1)
    best = v[int(np.concatenate([_score(part, normals, lengths, up) for part in parts]).argmax())]
    for _ in range(5):
        weight = lengths * _closeness(best[None], normals)[0]
        best = np.linalg.eigh((weight[:, None] * normals).T @ normals)[1][:, 0]
        best = best if best @ up > 0 else -best
    support = float(_closeness(best[None], normals)[0] @ lengths)
    return best if support > LEAST_SUPPORT and best @ up > np.cos(LARGEST_TILT) else None


def may_be_upright(normals: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(N,) whether lines with these normals (N, 3) can run along a direction near ``up``."""
    return np.abs(normals @ up) < np.sin(LARGEST_TILT + LINE_SIGMA)


def meeting_directions(normals: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(n, 3) the directions near ``up`` in which pairs of lines with these normals (N, 3) meet."""
    i, j = np.triu_indices(len(normals), 1)
    v = np.cross(normals[i], normals[j])
    size = np.linalg.norm(v, axis=1)
    v = v[size > 0.02] / size[size > 0.02, None]
    v *= np.where(v @ up < 0, -1.0, 1.0)[:, None]
    return v[v @ up > np.cos(LARGEST_TILT)]


def _closeness(v: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(n, N) how well lines agree with directions (n, 3): 1 at no angle."""
    return np.exp(-0.5 * (v @ normals.T / LINE_SIGMA) ** 2)


def _score(v: np.ndarray, normals: np.ndarray, lengths: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(n,) of directions (n, 3): see above."""
    angle = np.arccos(np.clip(v @ up, -1.0, 1.0))
    return KAPPA * (_closeness(v, normals) @ lengths) - 0.5 * (angle / BODY_SIGMA) ** 2
