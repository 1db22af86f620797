# SPDX-License-Identifier: GPL-3.0-or-later
"""What the lifting network sees of a frame: a window of moments around it, evenly spaced in time.

The network was trained on moments `SPACING_S` apart, whatever the footage's frame rate: frames between which a moment
falls are mixed in proportion. A window ends where the person was not seen for longer than `LONGEST_GAP_S`, and its last
moment is then repeated; a picture is a window that stands still.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

WINDOW = 9  # moments, the frame itself in the middle
SPACING_S = 0.1
MIDDLE = WINDOW // 2
OFFSETS_S = (np.arange(WINDOW) - MIDDLE) * SPACING_S
LONGEST_GAP_S = 0.25


@dataclass(frozen=True)
class Windows:
    """Rows to be mixed for each of T frames: ``(1 - share) x[before] + share x[after]``, each (T, WINDOW)."""

    before: np.ndarray
    after: np.ndarray
    share: np.ndarray

    def of(self, x: np.ndarray, rows: np.ndarray, first: int) -> np.ndarray:
        """(n, WINDOW, ...) of the frames ``rows`` (n,), from ``x``, whose row 0 is that of frame ``first``."""
        share = self.share[rows].astype(x.dtype)[..., None]
        out = x[self.before[rows] - first] * (1 - share)
        out += x[self.after[rows] - first] * share
        out[:, MIDDLE] = x[rows - first]
        return out

    def span(self, rows: np.ndarray) -> tuple[int, int]:
        """First and one past the last row that the frames ``rows`` need."""
        least = min(int(rows[0]), int(self.before[rows].min()))
        return least, max(int(rows[-1]), int(self.after[rows].max())) + 1


def windows_around(times: np.ndarray, seen: np.ndarray) -> Windows:
    """The windows of frames at ``times`` (T,) seconds, made of those that were ``seen`` (T,) bool.

    A frame that was not seen has a window of those around it.
    """
    rows = np.flatnonzero(seen)
    if not len(rows):
        rows = np.arange(len(times))
    known = times[rows]
    run = np.concatenate([[0], np.cumsum(np.diff(known) > LONGEST_GAP_S)])
    own = np.maximum(np.searchsorted(rows, np.arange(len(times)), side="right") - 1, 0)  # the last one seen
    low, high = (ends[own, None] for ends in ends_of_runs(run))
    moments = times[:, None] + OFFSETS_S
    after = np.clip(np.searchsorted(known, moments), low, high)
    before = np.maximum(after - 1, low)
    length = known[after] - known[before]
    share = np.clip((moments - known[before]) / np.maximum(length, 1e-9), 0.0, 1.0) * (length > 0)
    return Windows(rows[before], rows[after], share.astype(np.float32))


def ends_of_runs(numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of the first and of the last equal number, of each of (n,) numbers that never fall."""
    return np.searchsorted(numbers, numbers), np.searchsorted(numbers, numbers, side="right") - 1


def standing_still(count: int) -> Windows:
    """The windows of pictures that have nothing to do with each other."""
    rows = np.repeat(np.arange(count)[:, None], WINDOW, axis=1)
    return Windows(rows, rows, np.zeros((count, WINDOW), np.float32))
