# SPDX-License-Identifier: GPL-3.0-or-later
"""What every source of frames is, and the frames that it gives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..clock import Clock

DEFAULT_FPS = Fraction(30)


@dataclass(frozen=True)
class Picture:
    """One frame: its index and time in the source, when it came (seconds of the clock), and the (H,
    W, 3) RGB image.
    """

    index: int
    timestamp_s: float
    arrived_s: float
    image_rgb: NDArray[np.uint8]


class Source(Protocol):
    """A source of frames that can be opened again."""

    name: str  # for messages and the motion file
    # whether the end of its frames is the end of the capture, rather than an interruption
    ends: bool
    fps: Fraction  # nominal
    focal_35mm: float | None

    def pictures(self, clock: Clock) -> Iterator[Picture | None]:
        """Open the source and yield its frames as they come; their number begins with 0, their time
        anywhere.

        None stands for a frame that was damaged on its way and is left out.

        :raises VideoError: the source cannot be opened, or fails.
        """
