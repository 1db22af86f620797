# SPDX-License-Identifier: GPL-3.0-or-later
"""What was observed in one window of a clip."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...camera.background_record import BackgroundRecord
from ...perception.observation import PendingReference
from ...perception.region import Region
from ...tracking.track import Tracklet
from .plan import Window


@dataclass
class WindowRecord:
    """N frames from the one in which the trackers began; the first ``first`` of them belong to the
    window before.

    ``checksums`` are those of the images in the frames that two windows share, and 0 elsewhere.
    ``anchor`` is the row in which the trackers of the next window begin, N if there is none, and
    ``anchor_regions`` holds the regions of the people in it, by tracklet. The rows of
    ``tracklets``, whose references are not pending, count from 0. ``cut_rows`` are those of the
    window's own frames that begin another scene. ``execution``: what the networks ran on.
    """

    window: Window
    indices: NDArray[np.int64]  # (N,) of the frames in the source
    timestamps: NDArray[np.float64]  # (N,) seconds
    checksums: NDArray[np.uint32]  # (N,)
    first: int
    anchor: int
    tracklets: dict[int, Tracklet]
    anchor_regions: dict[int, Region]
    cut_rows: list[int]
    background: BackgroundRecord
    execution: str = ""
    warnings: Sequence[str] = ()

    def __len__(self) -> int:
        return len(self.timestamps)

    def continues(self, before: WindowRecord) -> bool:
        """Return whether the frames that this window shares with the one before are the same images
        there.
        """
        same_times = np.array_equal(
            before.timestamps[before.anchor :], self.timestamps[: self.first]
        )
        return same_times and np.array_equal(
            before.checksums[before.anchor :], self.checksums[: self.first]
        )


def known_reference(landmarks: NDArray[Any] | None) -> PendingReference:
    """Return the result of the reference network as if it had been pending.

    :param landmarks: (33, 3) metres; None: it found no body.
    """
    call: PendingReference = Future()
    call.set_result(landmarks)
    return call
