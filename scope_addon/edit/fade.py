# SPDX-License-Identifier: GPL-3.0-or-later
"""Interpolating a correction between the keys where it is known, and fading it out beyond them.

A monotone cubic (Fritsch and Carlson, *Monotone Piecewise Cubic Interpolation*, 1980): the
correction never overshoots what is known, and its slope is zero where it begins and ends.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def faded(
    times: NDArray[np.float64],
    known: NDArray[np.float64],
    values: NDArray[np.float64],
    reach: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Interpolate values that fade to zero ``reach`` seconds beyond the known ones.

    Between two known values it interpolates, unless they are farther apart than twice the sum of
    their reaches.

    :param times: (T,) seconds at which the values are wanted.
    :param known: (H,) seconds, increasing.
    :param values: (H, ...) at the known times.
    :param reach: (H,) seconds.
    :return: (T, ...).
    """
    flat = values.reshape(len(values), -1)
    zero = np.zeros((1, flat.shape[1]))
    at = [np.array([known[0] - reach[0]])]
    rows = [zero]
    for k in range(len(known)):
        at.append(known[k : k + 1])
        rows.append(flat[k : k + 1])
        apart = k + 1 < len(known) and known[k + 1] - known[k] > 2 * (reach[k] + reach[k + 1])
        if apart or k + 1 == len(known):
            at.append(known[k : k + 1] + reach[k])
            rows.append(zero)
        if apart:
            at.append(known[k + 1 : k + 2] - reach[k + 1])
            rows.append(zero)
    inside: NDArray[np.float64] = _monotone_cubic(times, np.concatenate(at), np.concatenate(rows))
    return inside.reshape(len(times), *values.shape[1:])


def _monotone_cubic(
    times: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Evaluate the monotone cubic through (x, y) with zero slopes at both ends; zero beyond them.

    :param x: (H,) increasing; y: (H, D), zero at both ends.
    """
    step = np.diff(x)[:, None]
    slope = np.diff(y, axis=0) / step
    m = np.zeros_like(y)
    before = slope[:-1]
    after = slope[1:]
    # The slope is the harmonic mean of both sides where these have the same sign.
    with np.errstate(divide="ignore", invalid="ignore"):
        w0 = 2 * step[1:] + step[:-1]
        w1 = step[1:] + 2 * step[:-1]
        mean = (w0 + w1) / (w0 / before + w1 / after)
    m[1:-1] = np.where(before * after > 0, mean, 0.0)
    k = np.clip(np.searchsorted(x, times, side="right") - 1, 0, len(x) - 2)
    s = np.clip((times - x[k]) / (x[k + 1] - x[k]), 0.0, 1.0)[:, None]
    h = (x[k + 1] - x[k])[:, None]
    value: NDArray[np.float64]
    value = (1 + 2 * s) * (1 - s) ** 2 * y[k] + s**2 * (3 - 2 * s) * y[k + 1]
    value += h * s * (1 - s) * ((1 - s) * m[k] - s * m[k + 1])
    return value
