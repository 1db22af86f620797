# SPDX-License-Identifier: GPL-3.0-or-later
"""Which takes train the network and which measure it."""

from __future__ import annotations

import numpy as np

from .augment import Motions

HELD_OUT_EVERY = 10


def is_held_out(take: np.ndarray) -> np.ndarray:
    """Whether the takes of these numbers measure and do not train."""
    return take % HELD_OUT_EVERY == HELD_OUT_EVERY - 1


def training_frames(motions: Motions) -> Motions:
    """All takes but every tenth."""
    return motions.select(~is_held_out(motions.take))


def held_out_frames(motions: Motions) -> Motions:
    """Every tenth take."""
    return motions.select(is_held_out(motions.take))
