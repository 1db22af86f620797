# SPDX-License-Identifier: GPL-3.0-or-later
"""Means over people, with confidence intervals by the bootstrap over people, or over who performed
their motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 4000
SEED = 5
CONFIDENCE = 0.95


class Estimate(NamedTuple):
    """A mean over people, its interval, and how many people have a value."""

    mean: float
    low: float
    high: float
    people: int

    @property
    def text(self) -> str:
        """The mean and, in parentheses, its interval if there is one; a dash of nobody."""
        if not self.people:
            return "–"
        interval = f" ({self.low:.1f} to {self.high:.1f})" if self.people > 1 else ""
        return f"{self.mean:.1f}{interval}"


def mean_over_people(values: Sequence[float] | NDArray[np.float64]) -> Estimate:
    """Return the mean of one value a person, with the bootstrap's percentile interval (Efron 1979)
    of 95 %.

    Frames of one clip resemble each other, so people are drawn with replacement, not frames. With
    fewer than two people, the interval is NaN.

    :param values: (n,), NaN where a person has no value.
    """
    found = np.asarray(values, float)
    found = found[np.isfinite(found)]
    if len(found) < 2:
        return Estimate(float(found.mean()) if len(found) else np.nan, np.nan, np.nan, len(found))
    drawn = np.random.default_rng(SEED).integers(len(found), size=(RESAMPLES, len(found)))
    low, high = np.quantile(found[drawn].mean(axis=1), [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return Estimate(float(found.mean()), float(low), float(high), len(found))


def mean_over_performers(
    values: Sequence[float] | NDArray[np.float64], performers: Sequence[str]
) -> Estimate:
    """Return the mean of one value a person, with an interval that whole performers are drawn for.

    People who move as the same performer does resemble each other, so performers are drawn with
    replacement, each with all of their people. With fewer than two performers, the interval is NaN.

    :param values: (n,), NaN where a person has no value; ``performers``: n names.
    """
    found = np.asarray(values, float)
    names = np.asarray(performers)
    names = names[np.isfinite(found)]
    found = found[np.isfinite(found)]
    of = [found[names == name] for name in np.unique(names)]
    if len(of) < 2:
        return Estimate(float(found.mean()) if len(found) else np.nan, np.nan, np.nan, len(found))
    sums = np.array([each.sum() for each in of])
    counts = np.array([len(each) for each in of])
    drawn = np.random.default_rng(SEED).integers(len(of), size=(RESAMPLES, len(of)))
    means = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    low, high = np.quantile(means, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return Estimate(float(found.mean()), float(low), float(high), len(found))
