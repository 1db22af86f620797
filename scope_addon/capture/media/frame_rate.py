# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact frame rates, as rationals, of containers that report a float or nothing."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from .frame_readers import PyavReader

DEFAULT_FPS = Fraction(30)  # where footage has no rate; the most common one
_STANDARD_RATES = [Fraction(n) for n in (24, 25, 30, 48, 50, 60, 120, 240)]
_STANDARD_RATES += [Fraction(n * 1000, 1001) for n in (24, 30, 48, 60, 120, 240)]


def exact_fps(fps: float) -> Fraction | None:
    """Convert a float frame rate to the rational that it stands for; None if it is not a rate (0, NaN, 90000).

    A ratio of small integers survives the conversion to float and is returned as it is (30000/1001, 2997/100). A rate
    averaged over a file's duration is not such a ratio; it becomes the standard rate within 0.001 %, if there is one.
    """
    if not 0.01 < fps <= 1000:  # also False for NaN
        return None
    simple = Fraction(fps).limit_denominator(1001)
    if abs(simple - Fraction(fps)) < Fraction(fps) / 10**11:
        return simple
    nearest = min(_STANDARD_RATES, key=lambda rate: abs(rate - Fraction(fps)))
    if abs(nearest - Fraction(fps)) < nearest / 10**5:
        return nearest
    return Fraction(fps).limit_denominator(100_000)


def estimate_fps(reader: PyavReader) -> Fraction:
    """Estimate the rate from the timestamps of the next 30 frames, for a container that does not report it."""
    times: list[float] = []
    while len(times) < 30 and (decoded := reader.read()) is not None:
        times.append(decoded[0] or 0.0)
    steps = np.diff(times)
    steps = steps[steps > 0]
    return (exact_fps(round(1 / float(np.median(steps)), 2)) if len(steps) else None) or DEFAULT_FPS
