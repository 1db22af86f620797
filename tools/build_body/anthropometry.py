# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements of people, as published, and people drawn from them.

Adults: Gordon et al., 2012 Anthropometric Survey of U.S. Army Personnel (ANSUR II),
NATICK/TR-15/007, 2014: 4,082 men and 1,986 women. The figures are quoted from knowledge of the
published tables, not copied cell by cell. What was checked: each measurement's mean and deviation
over both sexes together, which follow from the values here within 1 mm or 1 kg. ``epicondyle`` and
``tragion`` are split by sex roughly in proportion to the stature. The correlations are rounded,
follow those of the survey before (Cheverud et al., NATICK/TR-90/032, 1990), and are the same for
both sexes; they could not be checked.

Soldiers must not be heavy. For two in five adults, weight, waist and hips are those of civilians
(after Fryar et al., Vital and Health Statistics 3(46), 2021, rounded; hip breadths and deviations
are estimates).

Children: medians of the CDC growth charts of 2000 (Kuczmarski et al., Vital and Health Statistics
11(246)), and sitting heights over stature (Fredriks et al., Arch. Dis. Child. 90, 2005), both
rounded and from knowledge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Measured = dict[str, NDArray[np.float64]]

# Measurement -> (mean, standard deviation) of men, of women; metres and kilograms.
ADULTS = {
    "stature": ((1.7562, 0.0686), (1.6285, 0.0642)),
    "sitting": ((0.9184, 0.0357), (0.8566, 0.0332)),
    "acromion": ((1.4407, 0.0633), (1.3351, 0.0580)),
    "epicondyle": ((0.4943, 0.0254), (0.4605, 0.0233)),
    "biacromial": ((0.4157, 0.0192), (0.3653, 0.0182)),
    "hip_breadth": ((0.3457, 0.0244), (0.3538, 0.0262)),
    "waist": ((0.9406, 0.1117), (0.8609, 0.0996)),
    "weight": ((85.5, 14.2), (67.8, 11.0)),
    "upper_arm": ((0.3354, 0.0174), (0.3109, 0.0168)),  # acromion to radiale
    "forearm": ((0.2679, 0.0155), (0.2413, 0.0149)),  # radiale to stylion
    "foot": ((0.2712, 0.0131), (0.2463, 0.0123)),
    "tragion": ((0.1310, 0.0064), (0.1268, 0.0062)),  # to the top of the head
    "head_breadth": ((0.1541, 0.0056), (0.1482, 0.0053)),
}
CIVILIANS = {
    "hip_breadth": ((0.357, 0.032), (0.375, 0.042)),
    "waist": ((1.000, 0.150), (0.945, 0.160)),
    "weight": ((90.0, 20.0), (76.0, 19.0)),
}
CIVILIAN_SHARE = 0.4
LOGNORMAL = ("weight", "waist", "hip_breadth")  # skewed to the heavy side
WEIGHTS_KG = (42.0, 155.0)  # of adults; the tails are clipped
# Correlations, upper triangle in the order of ADULTS.
CORRELATIONS = (
    (0.77, 0.96, 0.88, 0.42, 0.38, 0.25, 0.50, 0.80, 0.72, 0.70, 0.32, 0.22),
    (0.71, 0.50, 0.36, 0.36, 0.22, 0.45, 0.49, 0.41, 0.48, 0.36, 0.22),
    (0.87, 0.41, 0.38, 0.27, 0.51, 0.82, 0.72, 0.69, 0.25, 0.20),
    (0.36, 0.33, 0.21, 0.44, 0.78, 0.76, 0.70, 0.23, 0.17),
    (0.43, 0.34, 0.56, 0.40, 0.36, 0.43, 0.17, 0.25),
    (0.77, 0.84, 0.28, 0.20, 0.37, 0.12, 0.28),
    (0.88, 0.19, 0.11, 0.26, 0.08, 0.30),
    (0.40, 0.32, 0.47, 0.16, 0.35),
    (0.70, 0.64, 0.19, 0.16),
    (0.63, 0.16, 0.12),
    (0.22, 0.20),
    (0.15,),
)
# Age in years -> (stature, weight) of boys, of girls, and sitting height over stature.
CHILDREN = {
    6: ((1.155, 20.7), (1.150, 20.2), 0.548),
    8: ((1.280, 25.6), (1.275, 25.6), 0.538),
    10: ((1.385, 32.0), (1.380, 33.0), 0.528),
    12: ((1.490, 40.5), (1.515, 41.8), 0.520),
    14: ((1.635, 51.0), (1.605, 49.5), 0.519),
    16: ((1.735, 61.0), (1.625, 54.0), 0.523),
}
CHILD_SPREAD = {"stature": 0.045, "weight": 0.17, "sitting": 0.013}  # relative


def draw_adults(rng: np.random.Generator, male: NDArray[np.bool_]) -> Measured:
    """Draw the measurements of adults, (n,) each, for the sexes (n,) bool."""
    count = len(male)
    names = list(ADULTS)
    normal = rng.standard_normal((count, len(names))) @ np.linalg.cholesky(correlation_matrix()).T
    civilian = rng.random(count) < CIVILIAN_SHARE
    drawn: Measured = {}
    for k, name in enumerate(names):
        table = np.array(ADULTS[name])[np.where(male, 0, 1)]
        if name in CIVILIANS:
            table = np.where(
                civilian[:, None], np.array(CIVILIANS[name])[np.where(male, 0, 1)], table
            )
        mean, deviation = table.T
        if name in LOGNORMAL:
            spread = np.sqrt(np.log1p((deviation / mean) ** 2))
            drawn[name] = mean * np.exp(spread * normal[:, k] - 0.5 * spread**2)
        else:
            drawn[name] = mean + deviation * normal[:, k]
    drawn["weight"] = drawn["weight"].clip(*WEIGHTS_KG)
    return drawn


def draw_children(
    rng: np.random.Generator, male: NDArray[np.bool_]
) -> tuple[Measured, NDArray[np.float64]]:
    """Draw stature, sitting height and weight of children, (n,) each, and their ages in years
    (n,).
    """
    years = list(CHILDREN)
    age = rng.uniform(years[0], years[-1], len(male))
    mean = mean_children(age, male)
    (taller, sitting, heavier) = rng.standard_normal((3, len(male)))
    stature = mean["stature"] * (1.0 + CHILD_SPREAD["stature"] * taller)
    ratio = mean["sitting"] / mean["stature"]
    return {
        "stature": stature,
        "sitting": stature * ratio * (1.0 + CHILD_SPREAD["sitting"] * sitting),
        "weight": mean["weight"] * np.exp(CHILD_SPREAD["weight"] * (0.7 * taller + 0.7 * heavier)),
    }, age


def mean_children(age: NDArray[np.float64], male: NDArray[np.bool_]) -> Measured:
    """Return the mean stature, sitting height and weight, (n,) each, of children of these ages in
    years (n,).
    """
    rows = np.array([(*boy, *girl, ratio) for boy, girl, ratio in CHILDREN.values()])
    boy_m, boy_kg, girl_m, girl_kg, ratio = (
        np.interp(age, list(CHILDREN), column) for column in rows.T
    )
    stature = np.where(male, boy_m, girl_m)
    return {
        "stature": stature,
        "sitting": stature * ratio,
        "weight": np.where(male, boy_kg, girl_kg),
    }


def correlation_matrix() -> NDArray[np.float64]:
    """Return the nearest positive definite correlation matrix (n, n) of the measurements of
    adults.
    """
    R = np.eye(len(ADULTS))
    for i, row in enumerate(CORRELATIONS):
        R[i, i + 1 :] = R[i + 1 :, i] = row
    values, vectors = np.linalg.eigh(R)
    R = (vectors * values.clip(0.01)) @ vectors.T
    scale = np.sqrt(np.diag(R))
    return R / np.outer(scale, scale)
