# SPDX-License-Identifier: GPL-3.0-or-later
"""The up direction from the edges of buildings: walls, doors and posts are vertical, most other
edges horizontal.

A line in the picture and the camera's centre span a plane with unit normal n; an edge along
direction d satisfies n·d = 0. Given the body's up direction u_0, find up u and two horizontal
directions h and u × h, all orthogonal, that maximize

    −∠(u, u_0)² / 2σ² + κ Σ_i w_i max(2 c_i(u), c_i(h), c_i(u × h)),
    c_i(d) = exp(−(n_i·d)² / 2s²),

with w_i the line's length in sides of the picture. Vertical lines count twice, because lines agree
with one of two horizontal directions by chance more often. A grid of directions around u_0 is
evaluated, and the best ones are refined with each line assigned to the nearest direction
(`line_normal_equations`).

The result is rejected if three directions would explain as much of random lines. It is also
rejected if little of it is vertical, unless both horizontal directions are supported and no other
solution is nearly as good: then up is what is orthogonal to both.

A single horizontal direction is reported wherever long lines agree on it, because up may be
ambiguous only about it.

Source: Coughlan and Yuille 2003.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....solver.rotations import exp
from ...arrays import Float64Array, unit_vectors
from .line_segments import Lines
from .manhattan import PLANE_SIGMA, line_normal_equations

MAX_LEAN = np.radians(35.0)  # between the body's up direction and the lines'
BODY_SIGMA = np.radians(10.0)  # σ
KAPPA = 4.0
VALUE = np.array([2.0, 1.0, 1.0])  # of a line along u, h and u × h
MAX_LINES = 120
HORIZONTAL_CANDIDATES = 24  # lines, the longest ones, each of which may be horizontal
_BLOCK = 16  # up directions that are tried at once
GRID_STEP = np.radians(3.0)
GRID_SIGMA = np.radians(2.2)  # s on the grid; PLANE_SIGMA in the refinement
MAX_REFINED = 16
REFINEMENT_STEPS = 8
# The share of the lines that chance explains; a solution explains more by so many deviations.
CHANCE_SHARE = 0.25
CHANCE_SIGMAS = 1.5
MIN_VERTICAL = 0.25  # sides of the picture, all vertical lines together
MIN_HORIZONTAL = 1.0  # likewise, along each horizontal direction, where less is vertical
MIN_MARGIN = 3.0  # in score, to any other solution
MIN_ANGLE_TO_OTHER = np.radians(4.0)  # of that solution's up direction
# The largest slope of horizontal edges against the body's up direction: steeper ones may be stairs.
MAX_SLOPE = np.radians(15.0)


@dataclass(frozen=True)
class UpEstimate:
    """Directions estimated from lines. Where ``up`` is ambiguous, it may be so only about
    ``level``.
    """

    up: Float64Array | None = None  # (3,)
    # (3,) the horizontal direction of most lines, such as a fence's
    level: Float64Array | None = None


@dataclass(frozen=True)
class _Axes:
    directions: Float64Array  # (3, 3) rows u, h, u × h
    supports: Float64Array  # (3,) sides of the picture along each
    score: float


def estimate_up_from_lines(lines: Lines, up: Float64Array) -> UpEstimate:
    """Estimate the up direction and a horizontal direction; None for what the lines do not
    determine.

    :param up: (3,) unit vector, the body's up direction, in the lines' axes.
    """
    if not len(lines.lengths):
        return UpEstimate()
    lines = Lines(lines.normals[:MAX_LINES], lines.lengths[:MAX_LINES])
    best, *others = sorted(
        _refined(_best_on_grid(lines, up), lines, up), key=lambda axes: -axes.score
    )
    share = best.supports.sum() / lines.lengths.sum()
    count = np.square(lines.lengths.sum()) / np.square(lines.lengths).sum()
    found = best.directions[0]
    if share < CHANCE_SHARE + CHANCE_SIGMAS / np.sqrt(count) or found @ up < np.cos(MAX_LEAN):
        return UpEstimate()
    second = max(
        (o.score for o in others if o.directions[0] @ found < np.cos(MIN_ANGLE_TO_OTHER)),
        default=-np.inf,
    )
    is_clear = best.supports[1:].min() >= MIN_HORIZONTAL and best.score - second > MIN_MARGIN
    which = 1 + int(best.supports[1:].argmax())
    level = best.directions[which]
    has_level = best.supports[which] >= MIN_HORIZONTAL and abs(level @ up) < np.sin(MAX_SLOPE)
    has_up = best.supports[0] >= MIN_VERTICAL or is_clear
    return UpEstimate(found if has_up else None, level if has_level else None)


def _grid(up: Float64Array) -> Float64Array:
    """Return (n, 3) unit vectors around one."""
    across = np.linalg.svd(up[None])[2][1:]
    steps = np.tan(np.arange(-MAX_LEAN, MAX_LEAN + 1e-9, GRID_STEP))
    v = up + (steps[:, None, None] * across[0] + steps[:, None] * across[1]).reshape(-1, 3)
    v = unit_vectors(v)
    return v[v @ up > np.cos(MAX_LEAN)]


def _best_on_grid(lines: Lines, up: Float64Array) -> Float64Array:
    """Return the axes (n, 3, 3) of the best up directions around one, each with its best horizontal
    directions.
    """
    ups = _grid(up)
    found = [_best_with_ups(ups[k : k + _BLOCK], lines) for k in range(0, len(ups), _BLOCK)]
    support, axes = (np.concatenate(each) for each in zip(*found, strict=True))
    return axes[np.argsort(-_score(support, ups, up), kind="stable")[:MAX_REFINED]]


def _best_with_ups(ups: Float64Array, lines: Lines) -> tuple[Float64Array, Float64Array]:
    """Return the support and the axes (n, 3, 3) of the best horizontal directions for each of the
    up directions (n, 3).

    Of several weighted exponentials, the largest is that of the least exponent, which needs one
    call instead of three.
    """
    level = np.cross(
        np.concatenate([lines.normals[:HORIZONTAL_CANDIDATES], np.eye(3)]), ups[:, None]
    )
    size = np.linalg.norm(level, axis=2, keepdims=True)  # level: along a horizontal line
    level /= np.maximum(size, 0.1)
    across = np.cross(ups[:, None], level)
    off2 = np.square(level @ lines.normals.T)
    np.minimum(off2, np.square(across @ lines.normals.T), out=off2)
    scale = -0.5 / GRID_SIGMA**2
    np.minimum(
        off2, (np.square(ups @ lines.normals.T) + np.log(VALUE[0]) / scale)[:, None], out=off2
    )
    off2 *= scale
    support = np.where(size[..., 0] > 0.1, np.exp(off2, out=off2) @ lines.lengths, -np.inf)
    rows = np.arange(len(ups))
    best = support.argmax(axis=1)
    return support[rows, best], np.stack([ups, level[rows, best], across[rows, best]], axis=1)


def _refined(directions: Float64Array, lines: Lines, up: Float64Array) -> list[_Axes]:
    """Refine each of the axes (n, 3, 3)."""
    for _ in range(REFINEMENT_STEPS):
        H, g, _ = line_normal_equations(lines, directions, PLANE_SIGMA, VALUE)
        u = directions[:, 0]
        H = (
            KAPPA / PLANE_SIGMA**2 * H
            + (np.eye(3) - u[:, :, None] * u[:, None]) / BODY_SIGMA**2
            + 1e-9 * np.eye(3)
        )
        g = KAPPA / PLANE_SIGMA**2 * g + np.cross(u, up) / BODY_SIGMA**2
        directions = directions @ exp(np.linalg.solve(H, g[..., None])[..., 0]).swapaxes(1, 2)
    supports = line_normal_equations(lines, directions, PLANE_SIGMA)[2]
    scores = _score(supports @ VALUE, directions[:, 0], up)
    return [_Axes(*each) for each in zip(directions, supports, scores.tolist(), strict=True)]


def _score(support: Float64Array, u: Float64Array, up: Float64Array) -> Float64Array:
    """Return the scores (n,) of up directions (n, 3) that explain so much."""
    return KAPPA * support - 0.5 * np.square(np.arccos(np.clip(u @ up, -1.0, 1.0)) / BODY_SIGMA)
