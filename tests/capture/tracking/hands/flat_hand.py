# SPDX-License-Identifier: GPL-3.0-or-later
"""A flat hand with its fingers up, as the hand network would report it."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.capture.perception.hand_landmarks import HAND_LENGTH_M, HandEstimate
from scope.scope_addon.capture.perception.region import Region

SCALE = 500.0  # pixels per metre
LENGTH = HAND_LENGTH_M * SCALE
FINGERS = [(x, y) for x in (-0.25, -0.12, 0.0, 0.12, 0.24) for y in (-0.5, -0.65, -0.8, -1.0)]
SHAPE = np.array([(0.0, 0.0), *FINGERS])  # in hand lengths from the wrist


def hand_at(
    wrist_px: tuple[float, float], left: float = 0.95, presence: float = 0.95, size: float = 1.0
) -> HandEstimate:
    """Return a hand whose keypoints agree with those in space."""
    x, y = wrist_px
    world = np.pad(SHAPE * HAND_LENGTH_M, ((0, 0), (0, 1)))
    world[:, 2] = np.linspace(0.0, 0.02, len(world))
    region = Region((x, y - LENGTH / 2), 2 * LENGTH, 0.0)
    return HandEstimate(size * LENGTH * SHAPE + wrist_px, world, presence, left, region)
