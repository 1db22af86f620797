# SPDX-License-Identifier: GPL-3.0-or-later
"""Fewer keys with a bound on what that changes: every curve's keys are those that linear interpolation needs.

Blender interpolates a quaternion's four numbers linearly and normalizes; the bound holds for exactly that.
"""

from __future__ import annotations

import numpy as np

from ..errors import UsageError


def select_quaternion_keys(times: np.ndarray, q: np.ndarray, bound: float) -> np.ndarray:
    """Indices of the keys to keep so that no rotation (T, 4), on one hemisphere, is off by more than ``bound`` rad."""
    _check(bound)
    return _keep(times, q, lambda a, b, part: angles_between(_lerp(times, q, a, b, part), q[part]), bound)


def select_position_keys(times: np.ndarray, p: np.ndarray, bound: float) -> np.ndarray:
    """Indices of the keys to keep so that no position (T, n) is off by more than ``bound``, in its own unit."""
    _check(bound)
    return _keep(times, p, lambda a, b, part: np.linalg.norm(_lerp(times, p, a, b, part) - p[part], axis=1), bound)


def _check(bound: float) -> None:
    if not np.isfinite(bound) or bound <= 0:
        raise UsageError(f"keys are reduced within an error bound above zero, not {bound}")


def _keep(times: np.ndarray, values: np.ndarray, error, bound: float) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Ramer, Douglas and Peucker: a span whose worst key is off by more than the bound is split there."""
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


def _lerp(times: np.ndarray, values: np.ndarray, a: int, b: int, part: slice) -> np.ndarray:
    share = ((times[part] - times[a]) / (times[b] - times[a]))[:, None]
    return values[a] + share * (values[b] - values[a])


def angles_between(q: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """(...) angle in radians between rotations (..., 4), by the sine of a quarter of it: exact where it is small."""
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    chord = np.minimum(np.linalg.norm(q - wanted, axis=-1), np.linalg.norm(q + wanted, axis=-1))
    return 4.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))
