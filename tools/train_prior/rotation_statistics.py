# SPDX-License-Identifier: GPL-3.0-or-later
"""Means of rotations, weights of performers, and isotropic noise, for training and evaluation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...solver.rotations import exp, log


def mean_rotation(
    rotations: NDArray[np.float64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the weighted Karcher mean (3, 3) of rotations (n, 3, 3)."""
    mean = rotations[0]
    for _ in range(100):
        step = weights @ log(mean.T @ rotations) / weights.sum()
        mean = mean @ exp(step)
        if np.abs(step).max() < 1e-12:
            break
    return mean


def balanced(group: NDArray[np.str_], balance: float) -> NDArray[np.float64]:
    """Return probabilities (n,) by which a performer of n samples counts as n^(1 - balance)."""
    _, inverse, counts = np.unique(group, return_inverse=True, return_counts=True)
    p = (counts.astype(float) ** -balance)[inverse]
    return p / p.sum()


def blurred(
    rotations: NDArray[np.float64], degrees: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return rotations (..., 3, 3) with isotropic noise of standard deviations (...) about each
    axis.
    """
    noise = np.radians(degrees)[..., None] * rng.standard_normal(rotations.shape[:-1])
    return rotations @ exp(noise)
