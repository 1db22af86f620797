# SPDX-License-Identifier: GPL-3.0-or-later
"""The time of the current frame, so that tracking behaves alike at every frame rate."""

from __future__ import annotations

import math

FRAME_S = 1 / 30  # from one frame to the next where their times are unknown
EAGER_S = 10 * FRAME_S  # for which a lost hand or face is looked for in every frame, or nearly so
PATIENCE_S = 4 * FRAME_S  # between two attempts afterwards
_TOLERANCE_S = 0.005  # of a frame's time


def is_search_due(
    time_s: float, seen_s: float, searched_s: float, eager_step_s: float = 0.0
) -> bool:
    """Return whether a lost hand or face is to be looked for in the frame of this time.

    :param seen_s: when it was last seen; if never, when it was first looked for.
    :param searched_s: when it was last looked for.
    :param eager_step_s: least time between two attempts during the first `EAGER_S` after it was
        lost.
    """
    interval_s = eager_step_s if time_s - seen_s <= EAGER_S + _TOLERANCE_S else PATIENCE_S
    return time_s - searched_s >= interval_s - _TOLERANCE_S


class FrameClock:
    """Times of frames that come in order; ``step_s`` is the time since the frame before."""

    def __init__(self) -> None:
        self.time_s = -math.inf
        self.step_s = FRAME_S
        self.begin_s = 0.0

    def advance(self, time_s: float | None) -> None:
        """Go to the next frame.

        :param time_s: when it is shown; None: a thirtieth of a second after the one before.
        """
        before = self.time_s
        is_first = self.time_s == -math.inf
        if time_s is None:
            time_s = 0.0 if is_first else before + FRAME_S
        if is_first:
            self.begin_s = time_s
        elif time_s > before:
            self.step_s = time_s - before
        self.time_s = time_s

    def has_passed(self, interval_s: float, elapsed_s: float) -> bool:
        """Return whether this frame is the one nearest to the end of an interval, or a later
        one.
        """
        return elapsed_s + self.step_s / 2 >= interval_s

    def is_within(self, interval_s: float, since_s: float) -> bool:
        """Return whether an interval that began at ``since_s`` still lasts; the frame nearest to
        its end counts.
        """
        return self.time_s - since_s - self.step_s / 2 <= interval_s
