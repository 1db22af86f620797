# SPDX-License-Identifier: GPL-3.0-or-later
"""People whose height is known: what no camera tells, the size of everything, is known with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....solver import Body, Priors
from ...errors import UsageError

SIGMA_M = 0.005
SHORTEST_M, TALLEST_M = 0.5, 2.6  # of what may be meant at all
FARTHEST = 4.5  # deviations of the population to which a body's shapes can be believed
_ROUNDS = 3


def with_stature(priors: Priors, body: Body, height_m: float) -> Priors:
    """The priors with the shape of a person of this height: of all shapes so tall, the most common ones.

    The population's N(0, I) of β, given that the height h(β) of the rest pose's highest vertex over its lowest is
    known: Λ = I + g gᵀ/σ² and mean Λ⁻¹ g (H − h₀)/σ² = g (H − h₀) / (σ² + g·g), with h(β) = h₀ + g·β while these two
    vertices stay the same.
    """
    _, h0, g = _shape_of(body, height_m)
    information = np.eye(body.P) + np.outer(g, g) / SIGMA_M**2
    mean = g * (height_m - h0) / (SIGMA_M**2 + g @ g)
    return replace(priors, shape_mean=mean, shape_information=information)


def require_stature(body: Body, height_m: float) -> None:
    """:raises UsageError: nobody is so tall, or this body cannot be."""
    if not SHORTEST_M <= height_m <= TALLEST_M:
        most = f"{100 * SHORTEST_M:.0f} to {100 * TALLEST_M:.0f} cm"
        raise UsageError(f"nobody is {100 * height_m:g} cm tall: give a height from {most}")
    if body.P == 0:
        raise UsageError(f"the body '{body.name}' has a single shape, whose height cannot be set: leave the height out")
    betas, *_ = _shape_of(body, height_m)
    if np.linalg.norm(betas) > FARTHEST:
        unit = betas / np.linalg.norm(betas)
        low, high = sorted(100 * body.stature(side * FARTHEST * unit) for side in (-1, 1))
        what = f"can be {low:.0f} to {high:.0f} cm tall, not {100 * height_m:g}"
        raise UsageError(f"the body '{body.name}' {what}: leave the height out")


def _shape_of(body: Body, height_m: float) -> tuple[np.ndarray, float, np.ndarray]:
    """The most common shape (P,) of this height, and h₀ and g (P,) of its highest and lowest vertices."""
    betas, h0, g = np.zeros(body.P), 0.0, np.zeros(body.P)
    for _ in range(_ROUNDS):
        heights = body.rest_vertices(betas)[:, 1]
        top, bottom = int(heights.argmax()), int(heights.argmin())
        h0 = float(body.v_template[top, 1] - body.v_template[bottom, 1])
        g = body.shapedirs[top, 1] - body.shapedirs[bottom, 1]
        betas = g * (height_m - h0) / max(float(g @ g), 1e-12)
    return betas, h0, g
