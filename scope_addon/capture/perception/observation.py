# SPDX-License-Identifier: GPL-3.0-or-later
"""What the networks say about one person in one frame."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from .region import Region

PendingReference = Future[np.ndarray | None]
"""World landmarks (33, 3) that will be there, or None if there is nobody."""


@dataclass(frozen=True)
class Observation:
    """The person in one frame.

    ``keypoints_px`` (33, 2) pixels of the frame; ``keypoints_confidence`` (33,) 0..1; ``world_landmarks`` (33, 3)
    metres, the middle of the hips at 0, in camera axes (x right, y down, z forward), or all 0 where depth is unknown;
    ``presence``: the network's probability that there is a person; ``region``: where it looked; ``acquired``: the
    person was not followed from the frame before; ``appearance``: see `appearance`, in some frames;
    ``reference_landmarks``: what the strong network will say in place of ``world_landmarks``, in few frames. Order:
    `KEYPOINT_NAMES`. ``hands`` (2, 21, 6), when they are asked for: pixels, confidence and world landmarks of the left
    and right hand, see `hand_tracker`; zeros where not seen.
    """

    keypoints_px: np.ndarray
    keypoints_confidence: np.ndarray
    world_landmarks: np.ndarray
    presence: float
    region: Region
    acquired: bool
    appearance: np.ndarray | None = None
    reference_landmarks: PendingReference | None = None
    hands: np.ndarray | None = None
