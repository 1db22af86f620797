# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig's rest pose as retargeting sees it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Skeleton:
    """N bones at rest, parents before children."""

    names: tuple[str, ...]
    parents: np.ndarray  # (N,) index, −1 where there is none
    heads: np.ndarray  # (N, 3) metres, world frame
    tails: np.ndarray  # (N, 3)
    orientations: np.ndarray  # (N, 3, 3) bone axes in the world

    def index(self, name: str) -> int:
        """Place of a bone; −1 where there is none of that name."""
        try:
            return self.names.index(name)
        except ValueError:
            return -1

    def ancestors(self, bone: int) -> list[int]:
        """The bone, its parent, and so on up to a root."""
        found = []
        while bone >= 0:
            found.append(bone)
            bone = int(self.parents[bone])
        return found

    def children(self, bone: int) -> list[int]:
        """Direct children."""
        return [int(k) for k in np.flatnonzero(self.parents == bone)]
