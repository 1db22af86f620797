# SPDX-License-Identifier: GPL-3.0-or-later
"""People of known stature, which resolves the scale ambiguity of a single camera."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import Body, Priors
from ....solver.body_file import CHILD_BELOW_M, body_with_children, growth_of
from ...arrays import Float64Array, FloatArray
from ...errors import UsageError
from ...untrusted.body_file import load_body

SIGMA_M = 0.005
# Statures outside are input errors.
SHORTEST_M = 0.5
TALLEST_M = 2.6
# Standard deviations of the population up to which the shapes of a body are realistic.
MAX_DEVIATIONS = 4.5
# One year of age; below, growth extrapolated from that of six-year-olds makes legs too long.
SHORTEST_CHILD_M = 0.8
STIFFNESS = 4.0  # κ of ``with_unknown_stature``
# The mean of people in footage, in the first coefficients of our own bodies: trunk and upper arms
# that are longer against legs than those of the mean body, which follows surveys of bones and skin.
# Of six people whose joints are known from markers, from several cameras or from a fitted SMPL
# body, the trunk is 0.685 and the upper arm 0.371 of a leg, of the mean body 0.631 and 0.340, and
# here 0.689 and 0.362. The first coefficient keeps the stature.
_MEAN_SHAPE = (-0.27, 1.2, 0.0, 2.0)
# The s of `stature_sigma`, about the deviation of adults (benchmarks/notebook/shape.md).
UNKNOWN_M = 0.1
FIXED = 1e6  # information of a coefficient that does not vary
_ROUNDS = 3


def with_stature(priors: Priors, body: Body, height_m: float, sigma_m: float = SIGMA_M) -> Priors:
    """Return the priors for a person of known stature: the most probable shapes of this height.

    This is the population's N(μ, Λ₀⁻¹) of β, conditioned on the height h(β) of the rest pose's
    highest vertex above its lowest: Λ = Λ₀ + g gᵀ/σ² and mean
    μ + Λ₀⁻¹g (H − h₀ − g·μ) / (σ₀² + gᵀΛ₀⁻¹g), with h(β) = h₀ + g·β as long as these two vertices
    stay the same, and σ₀ = `SIGMA_M`. Λ₀ = I and μ is the mean of people in footage, but growth is
    fixed at 0 from `CHILD_BELOW_M` on, and μ = 0 below.

    :param sigma_m: σ in Λ; the mean has this height in any case.
    """
    h0, g = _extremes_at(body, height_m)
    mean, population = _people_of_age(body, height_m)
    taller = height_m - h0 - g @ mean
    return replace(
        priors,
        shape_mean=mean + g / population * taller / (SIGMA_M**2 + g @ (g / population)),
        shape_information=np.diag(population) + np.outer(g, g) / sigma_m**2,
    )


def with_unknown_stature(priors: Priors, body: Body) -> Priors:
    """Return the priors for a person whose stature is unknown: proportions that differ hardly
    change the stature.

    A single camera measures proportions, not size. Among people, short ones have relatively long
    trunks, so that under N(0, I) a long trunk makes a person short: exact keypoints of a person of
    1.75 m, with the mean's legs and a trunk 12 % longer, give 1.66 m. Λ = I + κ ĝĝᵀ, with ĝ the
    direction of β along which the stature h(β) grows, divides that pull by 1 + κ. The mean is that
    of people in footage. The person is taken for an adult: growth is fixed at 0.
    """
    population = _population(body, is_child=False)
    _, g = _extremes_at(body, body.stature())
    along = g / population
    along /= max(float(np.linalg.norm(along)), 1e-12)
    return replace(
        priors,
        shape_mean=mean_shape(body),
        shape_information=np.diag(population) + STIFFNESS * np.outer(along, along),
    )


def with_population(priors: Priors, body: Body) -> Priors:
    """Return the priors with the population of adults: N(μ, I) of β with the mean of people in
    footage, and no growth.
    """
    population = np.diag(_population(body, is_child=False))
    return replace(priors, shape_mean=mean_shape(body), shape_information=population)


def stature_sigma(
    body: Body, betas: FloatArray, information: NDArray[Any], is_given: bool
) -> float:
    """Return the standard deviation of the stature h(β), metres: σ² = gᵀ Λ⁻¹ g + s², with s = 0
    where it was given.

    Frames repeat each other's errors, so Λ is the information of one of them. Proportions tell the
    size only as far as they go together in the population, hence s = `UNKNOWN_M`. NaN for bodies of
    a single shape.

    :param betas: (P,) the shape.
    :param information: (P, P) Λ, priors included.
    :param is_given: the user gave the stature; one that follows from the floor does not count.
    """
    if body.P == 0:
        return float("nan")
    _, g = _shape_at(body, np.asarray(betas, float))
    variance = float(g @ np.linalg.solve(information, g))
    return float(np.sqrt(variance if is_given else variance + UNKNOWN_M**2))


def require_stature(body: Body, height_m: float) -> None:
    """Check that a stature, in metres, is possible for people and for this body.

    :raises UsageError: it is not.
    """
    if not SHORTEST_M <= height_m <= TALLEST_M:
        most = f"{100 * SHORTEST_M:.0f} to {100 * TALLEST_M:.0f} cm"
        raise UsageError(
            f"a height of {100 * height_m:g} cm is not plausible: give one from {most}"
        )
    if body.P == 0:
        raise UsageError(
            f"the body '{body.name}' has a single shape, whose height cannot be set: "
            "omit the height"
        )
    low, high = stature_range(body)
    if low <= height_m <= high:
        return
    what = (
        f"the body '{body.name}' can be {100 * low:.0f} to {100 * high:.0f} cm tall, not "
        f"{100 * height_m:g}"
    )
    other = body_with_children(body.name)
    if other != body.name and not body.file:
        low, high = stature_range(load_body(other))
        if low <= height_m <= high:
            raise UsageError(
                f"{what}: use the body '{other}', which can be {100 * low:.0f} to {100 * high:.0f} "
                "cm tall"
            )
    raise UsageError(f"{what}: omit the height")


def stature_range(body: Body) -> tuple[float, float]:
    """Return the least and the greatest stature that the body has in realistic shapes, metres.

    The most probable adults up to `MAX_DEVIATIONS`; with growth, children from `SHORTEST_CHILD_M`.
    """
    low, high = (_most_probable_stature(body, side * MAX_DEVIATIONS) for side in (-1.0, 1.0))
    return (low if growth_of(body) is None else SHORTEST_CHILD_M), high


def _most_probable_stature(body: Body, deviations: float) -> float:
    """Return the stature of the most probable adult so many standard deviations above the mean,
    metres.
    """
    betas = np.zeros(body.P)
    for _ in range(_ROUNDS):
        g = _shape_at(body, betas)[1] / _population(body, is_child=False)
        betas = deviations * g / max(float(np.linalg.norm(g)), 1e-12)
    return body.stature(betas)


def mean_shape(body: Body) -> Float64Array:
    """Return the coefficients (P,) of the mean of people in footage; zeros for bodies of others."""
    mean = np.zeros(body.P)
    if not body.file:
        mean[: len(_MEAN_SHAPE)] = _MEAN_SHAPE
    return mean


def _population(body: Body, is_child: bool) -> Float64Array:
    """Return the information (P,) of the coefficients among adults or among children."""
    information = np.ones(body.P)
    growth = growth_of(body)
    if growth is not None and not is_child:
        information[growth] = FIXED
    return information


def _people_of_age(body: Body, height_m: float) -> tuple[Float64Array, Float64Array]:
    """Return the mean (P,) and the information (P,) of the coefficients among those whom a stature
    may belong to: children or adults.
    """
    is_child = height_m < CHILD_BELOW_M
    mean = np.zeros(body.P) if is_child else mean_shape(body)
    return mean, _population(body, is_child)


def _extremes_at(body: Body, height_m: float) -> tuple[float, Float64Array]:
    """Return h₀ and g (P,) of the highest and the lowest vertex of the most probable shape of this
    height.
    """
    mean, population = _people_of_age(body, height_m)
    betas = mean
    h0 = 0.0
    g = np.zeros(body.P)
    for _ in range(_ROUNDS):
        h0, g = _shape_at(body, betas)
        taller = height_m - h0 - g @ mean
        betas = mean + g / population * taller / max(float(g @ (g / population)), 1e-12)
    return h0, g


def _shape_at(body: Body, betas: Float64Array) -> tuple[float, Float64Array]:
    """Return h₀ and g (P,) of the highest and the lowest vertex of this shape."""
    heights = body.rest_vertices(betas)[:, 1]
    top = int(heights.argmax())
    bottom = int(heights.argmin())
    h0 = float(body.v_template[top, 1] - body.v_template[bottom, 1])
    return h0, body.shapedirs[top, 1] - body.shapedirs[bottom, 1]
