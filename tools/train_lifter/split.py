# SPDX-License-Identifier: GPL-3.0-or-later
"""Split of the takes into training and held-out data."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..train_prior.data import RESERVED, TEST
from .motions import Motions

HELD_OUT_EVERY = 10
ARCHIVED = (
    # takes of the archives, whose numbers come first; those of the sets after them are held out by
    # performer
    149
)


def is_held_out(take: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return whether the takes with these numbers are held out regardless of who performs: every
    tenth of the archives.

    The renders and scenes with held-out motions show these.
    """
    return (take % HELD_OUT_EVERY == HELD_OUT_EVERY - 1) & (take < ARCHIVED)


def training_frames(motions: Motions) -> Motions:
    """Return the frames of all takes except every tenth and those of performers kept from all
    training.
    """
    return motions.select(~_held_out(motions))


def held_out_frames(motions: Motions) -> Motions:
    """Return the frames of every tenth take and of all takes of performers kept from all
    training.
    """
    return motions.select(_held_out(motions))


def _held_out(motions: Motions) -> NDArray[np.bool_]:
    return is_held_out(motions.take) | np.isin(motions.performers, TEST + RESERVED)
