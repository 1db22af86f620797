# SPDX-License-Identifier: GPL-3.0-or-later
"""People of known stature, which resolves the scale ambiguity of a single camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....solver import Body, Priors
from ...errors import UsageError

SIGMA_M = 0.005
SHORTEST_M, TALLEST_M = 0.5, 2.6  # statures outside are input errors
MAX_DEVIATIONS = 4.5  # standard deviations of the population up to which the shapes of a body are realistic
STIFFNESS = 4.0  # κ of ``with_unknown_stature``
_ROUNDS = 3


def with_stature(priors: Priors, body: Body, height_m: float) -> Priors:
    """Return the priors for a person of known stature: the most probable shapes of this height.

    This is the population's N(0, I) of β, conditioned on the height h(β) of the rest pose's highest vertex above its
    lowest: Λ = I + g gᵀ/σ² and mean Λ⁻¹ g (H − h₀)/σ² = g (H − h₀) / (σ² + g·g), with h(β) = h₀ + g·β as long as these
    two vertices stay the same.
    """
    _, h0, g = _shape_of(body, height_m)
    information = np.eye(body.P) + np.outer(g, g) / SIGMA_M**2
    mean = g * (height_m - h0) / (SIGMA_M**2 + g @ g)
    return replace(priors, shape_mean=mean, shape_information=information)


def with_unknown_stature(priors: Priors, body: Body) -> Priors:
    """Return the priors for a person whose stature is unknown: proportions that differ hardly change the stature.

    A single camera measures proportions, not size. Among people, short ones have relatively long trunks, so that under
    N(0, I) a long trunk makes a person short: exact keypoints of a person of 1.75 m, with the mean's legs and a trunk
    12 % longer, give 1.66 m. Λ = I + κ ĝĝᵀ, with ĝ the direction of β along which the stature h(β) grows,
    divides that pull by 1 + κ.
    """
    *_, g = _shape_of(body, body.stature())
    along = g / max(float(np.linalg.norm(g)), 1e-12)
    return replace(priors, shape_information=np.eye(body.P) + STIFFNESS * np.outer(along, along))


def require_stature(body: Body, height_m: float) -> None:
    """Check that a stature, in metres, is possible for people and for this body.

    :raises UsageError: it is not.
    """
    if not SHORTEST_M <= height_m <= TALLEST_M:
        most = f"{100 * SHORTEST_M:.0f} to {100 * TALLEST_M:.0f} cm"
        raise UsageError(f"a height of {100 * height_m:g} cm is not plausible: give one from {most}")
    if body.P == 0:
        raise UsageError(f"the body '{body.name}' has a single shape, whose height cannot be set: omit the height")
    betas, *_ = _shape_of(body, height_m)
    if np.linalg.norm(betas) > MAX_DEVIATIONS:
        unit = betas / np.linalg.norm(betas)
        low, high = sorted(100 * body.stature(side * MAX_DEVIATIONS * unit) for side in (-1, 1))
        what = f"can be {low:.0f} to {high:.0f} cm tall, not {100 * height_m:g}"
        raise UsageError(f"the body '{body.name}' {what}: omit the height")


def _shape_of(body: Body, height_m: float) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """Return the most probable shape (P,) of this height, and h₀ and g (P,) of its highest and lowest vertices."""
    betas, h0, g = np.zeros(body.P), 0.0, np.zeros(body.P)
    for _ in range(_ROUNDS):
        heights = body.rest_vertices(betas)[:, 1]
        top, bottom = int(heights.argmax()), int(heights.argmin())
        h0 = float(body.v_template[top, 1] - body.v_template[bottom, 1])
        g = body.shapedirs[top, 1] - body.shapedirs[bottom, 1]
        betas = g * (height_m - h0) / max(float(g @ g), 1e-12)
    return betas, h0, g
