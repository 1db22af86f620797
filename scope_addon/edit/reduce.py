# SPDX-License-Identifier: GPL-3.0-or-later
"""Key reduction with an error bound: each curve keeps only the keys that linear interpolation
needs.

Blender interpolates the four components of a quaternion linearly and normalizes; the bound holds
for exactly that.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError


def select_quaternion_keys(
    times: NDArray[np.float64], q: NDArray[np.float64], bound: float
) -> NDArray[np.intp]:
    """Select the keys that keep every rotation within an error bound.

    :param times: (T,) seconds.
    :param q: (T, 4) quaternions, all on one hemisphere.
    :param bound: maximum error, radians.
    :return: indices of the keys to keep.
    :raises UsageError: when the bound is not positive.
    """
    _check(bound)
    return _keep(
        times, lambda a, b, part: angles_between(_lerp(times, q, a, b, part), q[part]), bound
    )


def select_position_keys(
    times: NDArray[np.float64], p: NDArray[np.float64], bound: float
) -> NDArray[np.intp]:
    """Select the keys that keep every position within an error bound.

    :param times: (T,) seconds.
    :param p: (T, n) positions.
    :param bound: maximum error, in the unit of ``p``.
    :return: indices of the keys to keep.
    :raises UsageError: when the bound is not positive.
    """
    _check(bound)
    return _keep(
        times,
        lambda a, b, part: np.linalg.norm(_lerp(times, p, a, b, part) - p[part], axis=1),
        bound,
    )


def _check(bound: float) -> None:
    if not np.isfinite(bound) or bound <= 0:
        raise UsageError(f"the error bound must be above zero, not {bound}")


def _keep(
    times: NDArray[np.float64],
    error: Callable[[int, int, slice], NDArray[np.float64]],
    bound: float,
) -> NDArray[np.intp]:
    """Split a span at its worst key while the error exceeds the bound (Ramer, Douglas and Peucker).

    :param error: returns the errors of the keys in a slice, interpolated between two keys.
    """
    keep = np.zeros(len(times), bool)
    keep[[0, -1]] = True
    spans = [(0, len(times) - 1)]
    while spans:
        a, b = spans.pop()
        if b - a < 2:
            continue
        off = error(a, b, slice(a + 1, b))
        worst = int(off.argmax())
        if off[worst] > bound:
            middle = a + 1 + worst
            keep[middle] = True
            spans += [(a, middle), (middle, b)]
    return np.flatnonzero(keep)


def _lerp(
    times: NDArray[np.float64], values: NDArray[np.float64], a: int, b: int, part: slice
) -> NDArray[np.float64]:
    share: NDArray[np.float64] = ((times[part] - times[a]) / (times[b] - times[a]))[:, None]
    interpolated: NDArray[np.float64] = values[a] + share * (values[b] - values[a])
    return interpolated


def angles_between(q: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angles between rotations, by the sine of a quarter of each: accurate for small
    angles.

    :param q: (..., 4) quaternions of any length.
    :param wanted: (..., 4) unit quaternions.
    :return: (...) radians.
    """
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    chord = np.minimum(np.linalg.norm(q - wanted, axis=-1), np.linalg.norm(q + wanted, axis=-1))
    angles: NDArray[np.float64] = 4.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))
    return angles
