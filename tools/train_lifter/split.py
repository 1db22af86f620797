# SPDX-License-Identifier: GPL-3.0-or-later
"""Which takes train the network and which measure it."""

from __future__ import annotations

from .augment import Motions

HELD_OUT_EVERY = 10


def training_frames(motions: Motions) -> Motions:
    """All takes but every tenth."""
    return motions.select(motions.take % HELD_OUT_EVERY != HELD_OUT_EVERY - 1)


def held_out_frames(motions: Motions) -> Motions:
    """Every tenth take."""
    return motions.select(motions.take % HELD_OUT_EVERY == HELD_OUT_EVERY - 1)
