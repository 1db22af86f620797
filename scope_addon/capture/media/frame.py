# SPDX-License-Identifier: GPL-3.0-or-later
"""One decoded frame of the footage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Frame:
    """One frame: source index, presentation time in seconds, and the upright image (H, W, 3) uint8
    RGB.
    """

    index: int
    timestamp_s: float
    image_rgb: NDArray[np.uint8]
