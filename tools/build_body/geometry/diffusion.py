# SPDX-License-Identifier: GPL-3.0-or-later
"""Local averaging over mesh edges, for weights and for positions; symmetric where its input is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def perineum(mirror: NDArray[np.intp], vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lowest point of the mesh on the midline, (3,) metres."""
    midline = np.flatnonzero(mirror == np.arange(len(vertices)))
    return vertices[midline[vertices[midline, 1].argmin()]]


def bump(
    vertices: NDArray[np.float64], centre: NDArray[np.float64], radius: float
) -> NDArray[np.float64]:
    """Return (V,) factors: one at the centre, falling smoothly to zero at ``radius``."""
    distance = np.linalg.norm(vertices - centre, axis=1) / radius
    return np.clip(1.0 - distance**2, 0.0, None) ** 2


def diffuse(
    links: NDArray[np.intp], values: NDArray[np.float64], strength: NDArray[np.float64], rounds: int
) -> NDArray[np.float64]:
    """Move each vertex's row towards the mean of its neighbours by ``strength`` (V,) in [0, 1],
    ``rounds`` times.
    """
    active = np.flatnonzero(strength > 0.0)
    near = links[np.isin(links, active).any(axis=1)]
    degree = np.bincount(near.ravel(), minlength=len(values))[active, None]
    values = values.copy()
    for _ in range(rounds):
        total = np.zeros_like(values)
        np.add.at(total, near[:, 0], values[near[:, 1]])
        np.add.at(total, near[:, 1], values[near[:, 0]])
        values[active] += strength[active, None] * (total[active] / degree - values[active])
    return values
