# SPDX-License-Identifier: Apache-2.0
"""Cutting a clip into windows, and what they say together about the unknowns that they share."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..part import Array


class Window(NamedTuple):
    """Consecutive frames that are optimized together, and those of them whose result is kept."""

    frames: slice
    kept: slice


def overlapping(times: Array, length: float, overlap: float) -> list[Window]:
    """Return windows of `length` seconds that overlap, each kept up to the middle of its overlaps;
    one if that does.

    :param times: (T,) seconds, increasing.
    """
    T = len(times)
    span = float(times[-1] - times[0])
    if span <= length:
        return [Window(slice(0, T), slice(0, T))]
    count = int(np.ceil((span - overlap) / (length - overlap)))
    starts = times[0] + np.arange(count) * (span - length) / (count - 1)
    first = np.searchsorted(times, starts)
    last = np.searchsorted(times, starts + length, side="right")
    last[-1] = T
    # without overlap, rounding may leave a frame between two windows
    first[1:] = np.minimum(first[1:], last[:-1])
    middle = [0, *((a + b) // 2 for a, b in zip(first[1:], last[:-1], strict=True)), T]
    return [
        Window(slice(int(first[k]), int(last[k])), slice(int(middle[k]), int(middle[k + 1])))
        for k in range(count)
        if middle[k] < middle[k + 1]  # a longer gap between frames leaves windows empty
    ]


def tiles(windows: Sequence[Window]) -> list[Window]:
    """Return windows without overlap: what is kept of each."""
    return [Window(w.kept, w.kept) for w in windows]


def combined(
    estimates: Sequence[Array], informations: Sequence[Array], mean: Array, prior: Array
) -> Array:
    """Return the minimum (G,) of the sum of quadratics, each with the same prior, which shall count
    once.

    :param estimates: (G,) the minimum of each. :param informations: (G, G) its curvature, prior
        included.
    :param mean: (G,) and prior (G, G): the prior's mean and information.
    """
    total = prior + sum(I - prior for I in informations)
    right = prior @ mean + sum(
        I @ x - prior @ mean for I, x in zip(informations, estimates, strict=True)
    )
    out: Array = np.linalg.solve(total, right)
    return out
