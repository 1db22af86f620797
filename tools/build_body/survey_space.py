# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape space of measured people (`population`): principal components of their vertices and joints.

A component explains area-weighted variance of the skin and variance of the joints, in equal parts:

    Σ_v area_v / Σ area · |δv|² + 1 / (K+1) Σ_i |δJ_i|²

With the skin alone, build takes components that proportions of equal importance for a pose need: a trunk that is 3 cm
longer moves the skin less than a waist that is 10 cm wider. Every shape is shifted so that the pelvis joint stays at
the origin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .population import Population
from .shape_space import COMPONENTS, ShapeSpace


def build_survey_space(
    people: Population, body: NDArray[np.intp], area: NDArray[np.float64], regressor: NDArray[np.float64]
) -> ShapeSpace:
    """Compute the principal components of a population.

    :param body: (B,) indices of the vertices whose variance counts.
    :param area: (B,) their areas, the weights of the variance.
    :param regressor: (K+1, N) the joints whose variance counts.
    """
    moves, coefficients = people.moves, people.coefficients
    count = len(moves)
    centre = coefficients.mean(axis=0)
    scatter = np.linalg.cholesky(np.cov(coefficients.T) + 1e-12 * np.eye(count))  # Σ = L Lᵀ
    skin = moves[:, body] * np.sqrt(area / area.sum())[None, :, None]
    joints = np.tensordot(moves, regressor, axes=(1, 1)).transpose(0, 2, 1) / np.sqrt(len(regressor))
    weighted = np.concatenate([skin.reshape(count, -1), joints.reshape(count, -1)], axis=1)
    # Population covariance of the weighted positions is Wᵀ L Lᵀ W: its components are the right vectors of Lᵀ W.
    gram = scatter.T @ (weighted @ weighted.T) @ scatter
    values, vectors = np.linalg.eigh(gram)
    left = vectors[:, ::-1][:, :COMPONENTS]
    directions = (scatter @ left).T  # one standard deviation, in target coefficients
    components = np.tensordot(directions, moves, axes=1)
    mean = people.base + np.tensordot(centre, moves, axes=1)
    top, bottom = body[mean[body, 1].argmax()], body[mean[body, 1].argmin()]
    taller = components[:, top, 1] - components[:, bottom, 1]
    components *= np.where(taller < 0.0, -1.0, 1.0)[:, None, None]  # positive β is taller
    variance = values[::-1] / values.sum()
    return ShapeSpace(np.concatenate([mean[None], components]), variance[:COMPONENTS])
