# SPDX-License-Identifier: GPL-3.0-or-later
"""People of measured sizes as coefficients of MakeHuman's targets.

A macro target's coefficient is the product of the weights of the factors in its name; each factor
is piecewise linear in its slider, its weights summing to one (MakeHuman's rule):

    vertices(person) = base + Σ_t Π_f weight_f,t(person) · target_t
                       + Σ_d |x_d| · detail_d,incr or decr

Sex, age, muscle, proportions and ancestry are drawn. The sliders of height and weight and the
details x_d are solved for, by damped Gauss-Newton for all people at once, so that the person
measures what was drawn from the surveys:

    min Σ_m ((measure_m(x) − wanted_m) / tolerance_m)² + Σ_d (x_d / usual_d)²
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .anthropometry import Measured, draw_adults, draw_children, mean_children
from .landmarks import Landmarks, make_landmarks, wanted
from .source import SourceMesh
from .survey_targets import DETAILS, SurveyTargets

CHILD_SHARE = 0.05
FACTORS = {  # factor -> its levels and the slider's values there
    "gender": {"female": 0.0, "male": 1.0},
    "age": {"baby": 0.0, "child": 0.1875, "young": 0.5, "old": 1.0},
    "muscle": {"minmuscle": 0.0, "averagemuscle": 0.5, "maxmuscle": 1.0},
    "weight": {"minweight": 0.0, "averageweight": 0.5, "maxweight": 1.0},
    "height": {"minheight": 0.0, "": 0.5, "maxheight": 1.0},
    "proportions": {"uncommonproportions": 0.0, "": 0.5, "idealproportions": 1.0},
}
RACES = ("african", "asian", "caucasian")
YEARS = (1.0, 10.0, 25.0, 90.0)
AGE_SLIDER = (0.0, 0.1875, 0.5, 1.0)
SOLVED = ("height", "weight")
LIMITS = {"height": (-0.1, 1.15), "weight": (-0.2, 2.3)}  # linear beyond 0 and 1
DETAIL_LIMIT = 1.3
# Standard deviations of the details when nothing is measured; those of adults are mostly decided by
# the measurements.
USUAL = dict.fromkeys(DETAILS, 0.5) | {"belly": 0.15, "neck length": 0.25, "head height": 0.35}
TOLERANCE = {
    "stature": 0.003,
    "weight": 1.5,
    "waist": 0.03,
    "hip_breadth": 0.012,
    "head_breadth": 0.004,
}
TOLERANCE_M = 0.005  # of the others
ROUNDS = 8
WEIGH_IN = (0, 2, 4, 6)
STEP = 0.02  # of the differences that approximate derivatives


@dataclass
class Population:
    """People: ``coefficients`` (n, T) of ``moves`` (T, N, 3) metres, to be added to ``base`` (N,
    3).
    """

    base: NDArray[np.float64]
    moves: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    male: NDArray[np.bool_]
    age: NDArray[np.float64]  # years
    wanted: Measured
    measured: Measured


def draw_population(
    source: SourceMesh, targets: SurveyTargets, count: int, seed: int
) -> Population:
    """Draw people, the children after the adults. The pelvis joint is at the origin.

    :param count: of people; up to ten are all adults.
    :raises ValueError: ``count`` is not positive.
    """
    if count < 1:
        raise ValueError(f"cannot draw {count} people; draw at least one")
    solver = _Solver(source, targets)
    rng = np.random.default_rng(seed)
    children = round(CHILD_SHARE * count)
    male = np.arange(count) % 2 == 1
    of_adults = draw_adults(rng, male[children:])
    (of_children, years) = draw_children(rng, male[:children])
    adults = _Sliders.draw(rng, male[children:], rng.uniform(18.0, 75.0, count - children))
    young = _Sliders.draw(rng, male[:children], years)
    groups = [
        (group, survey)
        for group, survey in ((adults, of_adults), (young, of_children))
        if len(group)
    ]
    parts = [solver.solve(group, survey) for group, survey in groups]
    counts = [len(group) for group, _ in groups]
    return Population(
        solver.base,
        solver.moves,
        np.concatenate([part[0] for part in parts]),
        np.concatenate([male[children:], male[:children]]),
        np.concatenate([adults.years, young.years]),
        _joined([part[1] for part in parts], counts),
        _joined([part[2] for part in parts], counts),
    )


def mean_child(source: SourceMesh, targets: SurveyTargets, years: float) -> NDArray[np.float64]:
    """Return the vertices (N, 3) of the mean child of an age, of both sexes; the pelvis joint is at
    the origin.
    """
    solver = _Solver(source, targets)
    male = np.array([False, True])
    age = np.full(2, years)
    middle = dict.fromkeys(("muscle", "proportions", "height", "weight"), np.full(2, 0.5))
    values = middle | {"gender": male.astype(float), "age": np.interp(age, YEARS, AGE_SLIDER)}
    children = _Sliders(values, np.full((2, len(RACES)), 1.0 / len(RACES)), age)
    coefficients, *_ = solver.solve(children, mean_children(age, male))
    vertices: NDArray[np.float64] = solver.base + np.tensordot(
        coefficients.mean(axis=0), solver.moves, axes=1
    )
    return vertices


def _joined(parts: list[Measured], counts: list[int]) -> Measured:
    """Concatenate measurements; NaN where a part lacks one that the first part has."""
    return {
        key: np.concatenate(
            [each.get(key, np.full(n, np.nan)) for each, n in zip(parts, counts, strict=True)]
        )
        for key in parts[0]
    }


@dataclass
class _Sliders:
    """Values (n,) of the sliders, and the shares (n, 3) of ``RACES``."""

    values: dict[str, NDArray[np.float64]]
    races: NDArray[np.float64]
    years: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.years)

    @classmethod
    def draw(
        cls, rng: np.random.Generator, male: NDArray[np.bool_], years: NDArray[np.float64]
    ) -> _Sliders:
        count = len(male)
        blur = np.abs(rng.normal(0.0, 0.10, count)).clip(0.0, 0.5)
        return cls(
            {
                "gender": np.where(male, 1.0 - blur, blur),
                "age": np.interp(years, YEARS, AGE_SLIDER),
                "muscle": rng.normal(np.where(male, 0.55, 0.45), 0.17).clip(0.0, 1.0),
                "proportions": rng.normal(0.5, 0.15, count).clip(0.0, 1.0),
                "height": np.full(count, 0.5),
                "weight": np.full(count, 0.5),
            },
            rng.dirichlet(np.full(len(RACES), 2.0), count),
            years,
        )


class _Solver:
    def __init__(self, source: SourceMesh, targets: SurveyTargets) -> None:
        self.names = targets.names
        self.moves = np.concatenate([targets.macro, targets.details])
        pelvis = source.cubes["pelvis"]
        self.base = source.vertices - source.vertices[pelvis].mean(axis=0)
        self.moves -= self.moves[:, pelvis].mean(axis=1, keepdims=True)
        self.landmarks: Landmarks = make_landmarks(source)
        needed = np.flatnonzero(self.landmarks.rows.any(axis=0))
        rows = self.landmarks.rows[:, needed]
        self.base_points = rows @ self.base[needed]
        self.point_moves = (rows @ self.moves[:, needed]).reshape(len(self.moves), -1)
        used = np.unique(self.landmarks.skin)
        place = np.zeros(len(self.base), np.intp)
        place[used] = np.arange(len(used))
        self.skin = Landmarks(rows[:0], {}, place[self.landmarks.skin])
        self.skin_base = self.base[used].astype(np.float32)
        self.skin_moves = self.moves[:, used].reshape(len(self.moves), -1).astype(np.float32)

    def solve(
        self, sliders: _Sliders, survey: Measured
    ) -> tuple[NDArray[np.float64], Measured, Measured]:
        """Return coefficients (n, T), what was wanted and what came out."""
        goals = wanted(survey)
        keys = [*goals, "weight"]
        goals["weight"] = survey["weight"]
        tolerance = np.array([TOLERANCE.get(key, TOLERANCE_M) for key in keys])
        usual = np.array([1.0, 1.0, *(USUAL[d] for d in DETAILS)])
        low = np.array([*(LIMITS[s][0] for s in SOLVED), *np.full(len(DETAILS), -DETAIL_LIMIT)])
        high = np.array([*(LIMITS[s][1] for s in SOLVED), *np.full(len(DETAILS), DETAIL_LIMIT)])
        centre = np.array([0.5, 0.5, *np.zeros(len(DETAILS))])
        goal = np.stack([goals[key] for key in keys], axis=1)
        x = np.tile(centre, (len(sliders), 1))
        for k in range(ROUNDS):
            coefficients = self._coefficients(sliders, x)
            if k in WEIGH_IN:  # in between, the weight is linear in the coefficients
                at = coefficients
                (weight, gradient) = self._weight(coefficients)
            weights = weight + np.einsum("nt,nt->n", gradient, coefficients - at)
            value, J = self._linearize(sliders, x, centre, keys, weights, gradient)
            J /= tolerance[:, None]
            r = (value - goal) / tolerance
            H = np.einsum("nmk,nml->nkl", J, J) + np.diag(usual**-2.0)
            g = np.einsum("nmk,nm->nk", J, r) + (x - centre) / usual**2
            x = (x - 0.8 * np.linalg.solve(H, g[..., None])[..., 0]).clip(low, high)
        coefficients = self._coefficients(sliders, x)
        found = self._points(coefficients) | {"weight": self._weight(coefficients)[0]}
        return coefficients, goals, {key: found[key] for key in keys}

    def _linearize(
        self,
        sliders: _Sliders,
        x: NDArray[np.float64],
        centre: NDArray[np.float64],
        keys: list[str],
        weight: NDArray[np.float64],
        weight_gradient: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the measurements (n, M) of ``keys`` and their derivatives (n, M, X)."""
        coefficients = self._coefficients(sliders, x)
        found = self._points(coefficients) | {"weight": weight}
        value = np.stack([found[key] for key in keys], axis=1)
        J = np.empty((len(x), len(keys), x.shape[1]))
        for k in range(x.shape[1]):
            moved = x.copy()
            moved[:, k] += np.where(x[:, k] > centre[k], -STEP, STEP)
            step = (moved - x)[:, k]
            other = self._coefficients(sliders, moved)
            found = self._points(other)
            found["weight"] = weight + np.einsum("nt,nt->n", weight_gradient, other - coefficients)
            J[:, :, k] = (np.stack([found[key] for key in keys], axis=1) - value) / step[:, None]
        return value, J

    def _points(self, coefficients: NDArray[np.float64]) -> Measured:
        points = self.base_points + (coefficients @ self.point_moves).reshape(
            len(coefficients), -1, 3
        )
        return self.landmarks.measure(points)

    def _weight(
        self, coefficients: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the weights in kg (n,) and their derivatives (n, T) by the coefficients."""
        weights = []
        gradients = []
        for part in np.array_split(
            coefficients.astype(np.float32), max(1, len(coefficients) // 100)
        ):
            vertices = self.skin_base + (part @ self.skin_moves).reshape(len(part), -1, 3)
            weight, gradient = self.skin.weight(vertices)
            weights.append(weight)
            gradients.append(gradient.reshape(len(part), -1).astype(np.float32) @ self.skin_moves.T)
        return np.concatenate(weights), np.concatenate(gradients).astype(float)

    def _coefficients(self, sliders: _Sliders, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, T): macro targets from the sliders, then both ways of every detail."""
        values = sliders.values | {name: x[:, k] for k, name in enumerate(SOLVED)}
        weight = {name: share for name, share in zip(RACES, sliders.races.T, strict=True)}
        weight["universal"] = np.ones(len(x))
        for factor, levels in FACTORS.items():
            weight |= _level_weights(values[factor], levels)
        columns = [
            np.prod([weight[word] for word in name.split("/")[-1].split("-")], axis=0)
            for name in self.names
        ]
        for k in range(len(DETAILS)):
            detail = x[:, len(SOLVED) + k]
            columns += [detail.clip(0.0), (-detail).clip(0.0)]
        return np.stack(columns, axis=1)


def _level_weights(
    slider: NDArray[np.float64], levels: dict[str, float]
) -> dict[str, NDArray[np.float64]]:
    """Return the weights of a factor's levels: linear between two, and on in the same way beyond
    the ends.
    """
    names = list(levels)
    knots = np.array(list(levels.values()))
    k = np.searchsorted(knots, slider).clip(1, len(knots) - 1)
    share = (slider - knots[k - 1]) / (knots[k] - knots[k - 1])
    return {
        name: np.where(k == i, share, 0.0) + np.where(k - 1 == i, 1.0 - share, 0.0)
        for i, name in enumerate(names)
    }
