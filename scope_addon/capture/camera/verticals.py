# SPDX-License-Identifier: GPL-3.0-or-later
"""Which way is up by the edges of what people build: walls, doors and posts are upright, the rest is level.

A line in the picture and the camera's centre span a plane with unit normal n; an edge along direction d has n·d = 0.
With u_0 what the body says is up, up u and two level directions h and u × h, all at right angles, maximize

    −∠(u, u_0)² / 2σ² + κ Σ_i w_i max(2 c_i(u), c_i(h), c_i(u × h)),   c_i(d) = exp(−(n_i·d)² / 2s²),

w_i the line's length in sides of the picture. Lines that agree by chance are more often level than upright, where two
directions are to choose from. Directions around u_0 are tried, the best of them refined, each line then counted of the
direction that is nearest to it (`line_normal_equations`). Nothing is said where three directions would explain as much of lines
drawn at random, or where too little that is upright is to be seen, unless both level directions are, and no other ones
do nearly as well: then they tell what is upright to both.

What is level in one direction is told wherever long lines agree on it, for up may be unclear about it alone.

Source: Coughlan and Yuille 2003.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....solver.rotations import exp
from .line_segments import Lines
from .manhattan import NEARLY, line_normal_equations

LARGEST_LEAN = np.radians(35.0)  # between what the body says and what lines may say
BODY_SIGMA = np.radians(10.0)
KAPPA = 4.0
WORTH = np.array([2.0, 1.0, 1.0])  # of a line along u, h and u × h
MOST_LINES = 120
LEVEL_LINES = 24  # of which each may be level, the longest ones
STEP = np.radians(3.0)  # between the directions that are tried
TRIED_SIGMA = np.radians(2.2)  # s while they are
REFINED = 16
STEPS = 8
CHANCE_SHARE, CHANCE_SIGMAS = 0.25, 1.5  # of the lines that three directions explain by chance, and how certainly more
LEAST_UPRIGHT = 0.25  # sides of the picture, all upright lines together
LEAST_LEVEL = 1.0  # likewise, along each level direction, where less is upright
LEAST_MARGIN = 3.0  # and by how much any other up must be worse
OTHER = np.radians(4.0)  # at least so far off
LARGEST_SLOPE = np.radians(15.0)  # of level edges, by what the body says is up: steeper ones may be stairs


@dataclass(frozen=True)
class UpEstimate:
    """What lines say. Where ``up`` is not clear, ``level`` may be right nevertheless: up may still turn about it."""

    up: np.ndarray | None = None  # (3,) the upright direction
    level: np.ndarray | None = None  # (3,) the level one that most lines have, such as a wall's or a fence's


@dataclass(frozen=True)
class _Axes:
    directions: np.ndarray  # (3, 3) rows u, h, u × h
    supports: np.ndarray  # (3,) sides along each
    score: float


def estimate_up_from_lines(lines: Lines, up: np.ndarray) -> UpEstimate:
    """What lines say of up and level, near ``up``, what the body says; None for what they do not say."""
    if not len(lines.lengths):
        return UpEstimate()
    lines = Lines(lines.normals[:MOST_LINES], lines.lengths[:MOST_LINES])
    tried = sorted((_about(u, lines, up) for u in _around(up)), key=lambda scored: -scored[0])[:REFINED]
    best, *others = sorted((_refined(axes, lines, up) for _, axes in tried), key=lambda axes: -axes.score)
    share = best.supports.sum() / lines.lengths.sum()
    count = np.square(lines.lengths.sum()) / np.square(lines.lengths).sum()
    found = best.directions[0]
    if share < CHANCE_SHARE + CHANCE_SIGMAS / np.sqrt(count) or found @ up < np.cos(LARGEST_LEAN):
        return UpEstimate()
    second = max((o.score for o in others if o.directions[0] @ found < np.cos(OTHER)), default=-np.inf)
    is_clear = best.supports[1:].min() >= LEAST_LEVEL and best.score - second > LEAST_MARGIN
    which = 1 + int(best.supports[1:].argmax())
    level = best.directions[which]
    is_level = best.supports[which] >= LEAST_LEVEL and abs(level @ up) < np.sin(LARGEST_SLOPE)
    return UpEstimate(found if best.supports[0] >= LEAST_UPRIGHT or is_clear else None, level if is_level else None)


def _around(up: np.ndarray) -> np.ndarray:
    """(n, 3) unit vectors about one."""
    across = np.linalg.svd(up[None])[2][1:]
    steps = np.tan(np.arange(-LARGEST_LEAN, LARGEST_LEAN + 1e-9, STEP))
    v = up + (steps[:, None, None] * across[0] + steps[:, None] * across[1]).reshape(-1, 3)
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    return v[v @ up > np.cos(LARGEST_LEAN)]


def _about(u: np.ndarray, lines: Lines, up: np.ndarray) -> tuple[float, np.ndarray]:
    """The best directions (3, 3) with this up, roughly, after their score."""
    level = np.cross(np.concatenate([lines.normals[:LEVEL_LINES], np.eye(3)]), u)  # along the line, if it is level
    size = np.linalg.norm(level, axis=1)
    level = level[size > 0.1] / size[size > 0.1, None]
    across = np.cross(u, level)
    off2 = np.minimum(np.square(level @ lines.normals.T), np.square(across @ lines.normals.T))
    explained = np.exp(-0.5 / TRIED_SIGMA**2 * off2)
    explained = np.maximum(explained, WORTH[0] * np.exp(-0.5 / TRIED_SIGMA**2 * np.square(lines.normals @ u)))
    support = explained @ lines.lengths
    best = int(support.argmax())
    return _score(float(support[best]), u, up), np.array([u, level[best], across[best]])


def _refined(directions: np.ndarray, lines: Lines, up: np.ndarray) -> _Axes:
    for _ in range(STEPS):
        H, g, _ = line_normal_equations(lines, directions, NEARLY, WORTH)
        u = directions[0]
        H = KAPPA / NEARLY**2 * H + (np.eye(3) - np.outer(u, u)) / BODY_SIGMA**2 + 1e-9 * np.eye(3)
        g = KAPPA / NEARLY**2 * g + np.cross(u, up) / BODY_SIGMA**2
        directions = directions @ exp(np.linalg.solve(H, g)).T
    supports = line_normal_equations(lines, directions, NEARLY)[2]
    return _Axes(directions, supports, _score(float(WORTH @ supports), directions[0], up))


def _score(support: float, u: np.ndarray, up: np.ndarray) -> float:
    return KAPPA * support - 0.5 * float(np.arccos(np.clip(u @ up, -1.0, 1.0)) / BODY_SIGMA) ** 2
