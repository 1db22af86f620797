# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape space: adults of MakeHuman's macro sliders and lengths, and the principal components of
their vertices.

A target's coefficient is the product of the weights of the factors in its name; each factor is
piecewise linear in its slider, its weights summing to one (MakeHuman's rule):

    vertices(person) = base + Σ_t Π_f weight_f,t(person) · target_t

MakeHuman's targets of single lengths (``source.LENGTHS``) are added, because the sliders alone give
people of one stature the same upper arms and trunks, short trunks, and an arm span of 0.99 of the
stature. In measured adults it is 1.03 to 1.04, upper arm and forearm are 0.16 and 0.15 of it, and
the line from mid-hip to mid-shoulder 0.29 (women) to 0.30 (men; de Leva 1996). With the sliders
alone, they are 0.155, 0.141 and 0.291.

Every shape is shifted so that the pelvis joint stays at the origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .source import LENGTHS, SourceMesh

PEOPLE = 2000
COMPONENTS = 10
SEED = 20240917
FACTORS = {  # factor -> its levels; the first and last levels lie at slider 0 and 1
    "gender": ("female", "male"),
    "age": ("young", "old"),
    "muscle": ("minmuscle", "averagemuscle", "maxmuscle"),
    "weight": ("minweight", "averageweight", "maxweight"),
    "height": ("minheight", "", "maxheight"),
    "proportions": ("uncommonproportions", "", "idealproportions"),
}
RACES = ("african", "asian", "caucasian")
# mean and standard deviation in metres
STATURE = {"female": (1.625, 0.068), "male": (1.755, 0.071)}
# Length target -> relative mean and standard deviation of its change. The mean body's arm span
# becomes 1.035 of its stature and its trunk 0.30. Among people of one stature, the lengths of limbs
# vary by about 3 %, and the ratio of trunk to leg by 0.05; surveys say 0.046 (`anthropometry`).
LENGTHENING = {
    "arms/measure-upperarm-length": (0.067, 0.03),
    "arms/measure-lowerarm-length": (0.067, 0.02),
    "legs/measure-upperleg-height": (0.0, 0.04),
    "torso/measure-napetowaist-dist": (0.045, 0.06),
}


@dataclass(frozen=True)
class ShapeSpace:
    """Mean and components over all source vertices, pelvis at the origin.

    ``basis`` (1 + P, N, 3) metres: the mean first, then each component for one standard deviation.
    ``variance`` (P,): fraction of the area-weighted variance that each component explains.
    """

    basis: NDArray[np.float64]
    variance: NDArray[np.float64]


def build_shape_space(
    source: SourceMesh, body: NDArray[np.intp], area: NDArray[np.float64]
) -> ShapeSpace:
    """Compute the principal components of ``PEOPLE`` adults.

    :param body: (B,) indices of the vertices whose variance counts.
    :param area: (B,) their areas, the weights of the variance.
    """
    names = sorted(source.targets)
    moves = np.zeros((len(names), len(source.vertices), 3))
    for row, name in zip(moves, names, strict=True):
        indices, displacements = source.targets[name]
        row[indices] = displacements
    pelvis = source.cubes["pelvis"]
    base = source.vertices - source.vertices[pelvis].mean(axis=0)
    moves -= moves[:, pelvis].mean(axis=1, keepdims=True)

    gains = {
        name: _gain(source, base, move, name)
        for name, move in zip(names, moves, strict=True)
        if name.rpartition("-")[0] in LENGTHS
    }
    coefficients = _draw_people(names, gains, base[body], moves[:, body])
    centre = coefficients.mean(axis=0)
    scatter = np.linalg.cholesky(np.cov(coefficients.T) + 1e-12 * np.eye(len(names)))  # Σ = L Lᵀ
    weighted = (moves[:, body] * np.sqrt(area / area.sum())[None, :, None]).reshape(len(names), -1)
    # Population covariance of the weighted vertices is Wᵀ L Lᵀ W: its components are the right
    # vectors of Lᵀ W. They follow from the left ones, the eigenvectors of a small matrix.
    squared, left = (
        each[..., ::-1] for each in np.linalg.eigh(scatter.T @ (weighted @ weighted.T) @ scatter)
    )
    # one standard deviation, in target coefficients
    directions = (scatter @ left[:, :COMPONENTS]).T
    components = np.tensordot(directions, moves, axes=1)
    mean = base + np.tensordot(centre, moves, axes=1)
    top = body[mean[body, 1].argmax()]
    bottom = body[mean[body, 1].argmin()]
    taller = components[:, top, 1] - components[:, bottom, 1]
    components *= np.where(taller < 0.0, -1.0, 1.0)[:, None, None]  # positive β is taller
    variance = squared / np.sum(squared)
    return ShapeSpace(np.concatenate([mean[None], components]), variance[:COMPONENTS])


def _gain(
    source: SourceMesh, base: NDArray[np.float64], move: NDArray[np.float64], name: str
) -> float:
    """Return the change of a length by its target, relative to that of the base mesh."""
    a, b = (source.cubes[cube] for cube in LENGTHS[name.rpartition("-")[0]])
    before, after = (
        np.linalg.norm(v[a].mean(axis=0) - v[b].mean(axis=0)) for v in (base, base + move)
    )
    return float(after / before - 1.0)


def _draw_people(
    names: list[str], gains: dict[str, float], base: NDArray[np.float64], moves: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Draw coefficients (PEOPLE, targets). Stature is drawn in metres, and the height slider solved
    for it.

    :param gains: target of a length -> relative change of that length.
    """
    rng = np.random.default_rng(SEED)
    male = np.arange(PEOPLE) % 2 == 1
    blur = np.abs(rng.normal(0.0, 0.12, PEOPLE)).clip(0.0, 0.5)
    sliders = {
        "gender": np.where(male, 1.0 - blur, blur),
        "age": rng.beta(1.2, 2.5, PEOPLE),
        "muscle": rng.normal(0.5, 0.2, PEOPLE).clip(0.0, 1.0),
        "weight": rng.normal(0.5, 0.22, PEOPLE).clip(0.0, 1.0),
        "height": np.full(PEOPLE, 0.5),
        "proportions": rng.normal(0.5, 0.2, PEOPLE).clip(0.0, 1.0),
    }
    mean = np.where(male, STATURE["male"][0], STATURE["female"][0])
    spread = np.where(male, STATURE["male"][1], STATURE["female"][1])
    wanted = rng.normal(mean, spread)
    longer = {name: rng.normal(*LENGTHENING[name], PEOPLE) for name in LENGTHS}
    lengths = {
        name: (longer[name.rpartition("-")[0]] / gain).clip(0.0) for name, gain in gains.items()
    }

    top = base[:, 1].argmax()
    bottom = base[:, 1].argmin()
    span = moves[:, top, 1] - moves[:, bottom, 1]

    def stature(height: float) -> NDArray[np.float64]:
        sliders["height"] = np.full(PEOPLE, height)
        return base[top, 1] - base[bottom, 1] + _coefficients(names, sliders, lengths) @ span

    low = stature(0.0)
    middle = stature(0.5)
    high = stature(1.0)
    below = 0.5 * (wanted - low) / (middle - low)
    above = 0.5 + 0.5 * (wanted - middle) / (high - middle)
    sliders["height"] = np.where(wanted < middle, below, above).clip(0.0, 1.0)
    return _coefficients(names, sliders, lengths)


def _coefficients(
    names: list[str],
    sliders: dict[str, NDArray[np.float64]],
    lengths: dict[str, NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return (PEOPLE, targets): ``lengths`` are given by target, all others follow from the
    sliders.
    """
    weight = {}
    for factor, levels in FACTORS.items():
        knots = np.linspace(0.0, 1.0, len(levels))
        for level, knot in zip(levels, knots, strict=True):
            weight[level] = (1.0 - np.abs(sliders[factor] - knot) * (len(levels) - 1)).clip(0.0)
    weight |= dict.fromkeys(RACES, np.full(PEOPLE, 1.0 / len(RACES)))
    weight["universal"] = np.ones(PEOPLE)
    columns = [
        lengths[name]
        if name in lengths
        else np.prod([weight[word] for word in name.split("/")[-1].split("-")], axis=0)
        for name in names
    ]
    return np.stack(columns, axis=1)
