# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the windows of a clip begin and end.

All tracking starts afresh in each window, so what is observed in it depends on its frames alone. It
does so a little before the window, for the frames in which people are found and the regions settle;
these frames belong to the window before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...media.video import Video

WARM_UP_S = 1.5
MAX_WINDOWS = 10_000
_TOLERANCE_S = 1e-6  # of a frame's time, as in decoding


@dataclass(frozen=True)
class Window:
    """Frames from ``begin_s`` on, before ``end_s``; the trackers begin at ``anchor_s``."""

    number: int
    anchor_s: float
    begin_s: float
    end_s: float

    def has_begun(self, time_s: float) -> bool:
        """Return whether a frame at this time is not before the window's first one, as none of the
        first window is.
        """
        return not self.number or time_s >= self.begin_s - _TOLERANCE_S

    def warms_up(self, time_s: float) -> bool:
        """Return whether a frame at this time is not before the one in which the trackers begin."""
        return time_s >= self.anchor_s - _TOLERANCE_S

    def has_ended(self, time_s: float) -> bool:
        """Return whether a frame at this time comes after the window's last one."""
        return time_s >= self.end_s - _TOLERANCE_S


def plan_windows(video: Video, window_s: float) -> list[Window]:
    """Return the windows of the chosen range; a single one where it is shorter than two of them.

    The last window has whatever is left, also of footage that is longer than its container says.
    """
    start_s = video.wanted.start_s
    length_s = video.expected_frames / float(video.fps)
    count = max(1, min(int(length_s / window_s + 1e-9), MAX_WINDOWS))
    begins = [start_s + k * window_s for k in range(count)]
    ends = [*begins[1:], math.inf]
    warm_up_s = min(WARM_UP_S, window_s / 2)
    anchors = [start_s, *(begin - warm_up_s for begin in begins[1:])]
    return [Window(k, *times) for k, times in enumerate(zip(anchors, begins, ends, strict=True))]
