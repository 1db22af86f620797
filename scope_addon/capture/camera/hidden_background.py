# SPDX-License-Identifier: GPL-3.0-or-later
"""Which part of a static camera's background people have hidden in all frames so far."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..perception.region import inside, surroundings

CELLS = 40  # along either side of the image


class HiddenBackground:
    """A grid over the image; at first all of it is hidden.

    :param size: of the image, width and height in pixels.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._cell_px = np.array(size) / CELLS
        x, y = np.meshgrid(np.arange(CELLS), np.arange(CELLS))
        self._centers = (np.stack([x, y], axis=-1).reshape(-1, 2) + 0.5) * self._cell_px - 0.5
        self._hidden = np.ones(CELLS * CELLS, bool)

    def reveal(self, people: Sequence[NDArray[Any]]) -> None:
        """Add a frame with people at these points (n, 2) each, in pixels: what they do not hide has been seen."""
        self._hidden &= self._covered(people)

    def share_in_view(self, people: Sequence[NDArray[Any]]) -> float:
        """Return the share of the image that was hidden so far and is not hidden by people at these points (n, 2)."""
        return float((self._hidden & ~self._covered(people)).mean())

    def hides(self, points: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
        """Return (n,) whether each point (n, 2) of the image, in pixels, was hidden so far."""
        column, row = np.clip((points + 0.5) / self._cell_px, 0, CELLS - 1).astype(int).reshape(-1, 2).T
        hidden: NDArray[np.bool_] = self._hidden[row * CELLS + column]
        return hidden

    def _covered(self, people: Sequence[NDArray[Any]]) -> NDArray[np.bool_]:
        """Return whether each cell is wholly behind one of the people."""
        margin = 0.5 * np.concatenate([self._cell_px, -self._cell_px])
        return inside(self._centers, [surroundings(points) + margin for points in people])
