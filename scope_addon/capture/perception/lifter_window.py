# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows of the lifting network's input: samples around a frame, evenly spaced in time.

The network was trained with samples `SPACING_S` apart. At any frame rate, a sample between two frames is interpolated
linearly. A window ends where the person was not seen for longer than `LONGEST_GAP_S`; its last sample is then repeated.
The window of a still repeats one frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

WINDOW = 9  # samples, the frame itself in the middle
SPACING_S = 0.1
MIDDLE = WINDOW // 2
OFFSETS_S = (np.arange(WINDOW) - MIDDLE) * SPACING_S
LONGEST_GAP_S = 0.25


@dataclass(frozen=True)
class Windows:
    """Interpolation for each of T frames: ``(1 - share) x[before] + share x[after]``.

    ``before``, ``after`` (T, WINDOW) rows; ``share`` (T, WINDOW) float32, 0..1.
    """

    before: NDArray[np.intp]
    after: NDArray[np.intp]
    share: NDArray[np.float32]

    def gather(self, x: NDArray[np.float32], rows: NDArray[np.intp], first: int) -> NDArray[np.float32]:
        """Interpolate the windows of some frames.

        :param x: (N, C) values, whose row 0 is that of frame ``first``.
        :param rows: (n,) frames.
        :return: (n, WINDOW, C).
        """
        share = self.share[rows].astype(x.dtype)[..., None]
        out: NDArray[np.float32] = x[self.before[rows] - first] * (1 - share)
        out += x[self.after[rows] - first] * share
        out[:, MIDDLE] = x[rows - first]
        return out

    def span(self, rows: NDArray[np.intp]) -> tuple[int, int]:
        """Calculate the first row that the frames ``rows`` (n,) need, and one past the last."""
        least = min(int(rows[0]), int(self.before[rows].min()))
        return least, max(int(rows[-1]), int(self.after[rows].max())) + 1


def windows_around(times: NDArray[np.floating[Any]], seen: NDArray[np.bool_]) -> Windows:
    """Calculate the windows of T frames, from those in which the person was seen.

    :param times: (T,) seconds, ascending.
    :param seen: (T,) whether the person was seen. The windows of other frames consist of the seen frames around them.
    """
    rows = np.flatnonzero(seen)
    if not len(rows):
        rows = np.arange(len(times))
    known = times[rows]
    run = np.concatenate([[0], np.cumsum(np.diff(known) > LONGEST_GAP_S)])
    own = np.maximum(np.searchsorted(rows, np.arange(len(times)), side="right") - 1, 0)  # the last seen frame
    low, high = (ends[own, None] for ends in ends_of_runs(run))
    samples = times[:, None] + OFFSETS_S
    after = np.clip(np.searchsorted(known, samples), low, high)
    before = np.maximum(after - 1, low)
    length = known[after] - known[before]
    share = np.clip((samples - known[before]) / np.maximum(length, 1e-9), 0.0, 1.0) * (length > 0)
    return Windows(rows[before], rows[after], share.astype(np.float32))


def ends_of_runs(numbers: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find the indices (n,) of the first and of the last number equal to each of the non-decreasing numbers (n,)."""
    return np.searchsorted(numbers, numbers), np.searchsorted(numbers, numbers, side="right") - 1


def single_frame_windows(count: int) -> Windows:
    """Build the windows of unrelated stills."""
    rows = np.repeat(np.arange(count)[:, None], WINDOW, axis=1)
    return Windows(rows, rows, np.zeros((count, WINDOW), np.float32))
