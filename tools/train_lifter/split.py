# SPDX-License-Identifier: GPL-3.0-or-later
"""Split of the takes into training and held-out data."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .augment import Motions

HELD_OUT_EVERY = 10


def is_held_out(take: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return whether the takes with these numbers are held out."""
    return take % HELD_OUT_EVERY == HELD_OUT_EVERY - 1


def training_frames(motions: Motions) -> Motions:
    """Return the frames of all takes except every tenth."""
    return motions.select(~is_held_out(motions.take))


def held_out_frames(motions: Motions) -> Motions:
    """Return the frames of every tenth take."""
    return motions.select(is_held_out(motions.take))
