# SPDX-License-Identifier: GPL-3.0-or-later
"""Means of rotations, weights of performers, and isotropic noise, for training and evaluation."""

from __future__ import annotations

import numpy as np

from ...solver.rotations import exp, log


def mean_rotation(rotations: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the weighted Karcher mean (3, 3) of rotations (n, 3, 3)."""
    mean = rotations[0]
    for _ in range(100):
        step = weights @ log(mean.T @ rotations) / weights.sum()
        mean = mean @ exp(step)
        if np.abs(step).max() < 1e-12:
            break
    return mean


def balanced(group: np.ndarray, balance: float) -> np.ndarray:
    """Return probabilities (n,) by which a performer of n samples counts as n^(1 - balance)."""
    _, inverse, counts = np.unique(group, return_inverse=True, return_counts=True)
    p = (counts.astype(float) ** -balance)[inverse]
    return p / p.sum()


def blurred(rotations: np.ndarray, degrees: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return rotations (..., 3, 3) with isotropic noise of standard deviations (...) about each axis."""
    noise = np.radians(degrees)[..., None] * rng.standard_normal(rotations.shape[:-1])
    return rotations @ exp(noise)
