# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frames to process where not every one can be: every n-th, rather than whichever comes when
there is time.

A processor that takes 20 ms for a frame and gets one every 17 ms would process frames 17, 33 or 50
ms apart. Smoothing passes that on as jitter: velocities are known from the frames before, and each
of these tells of another moment.

The first seconds, in which size and floor are estimated as well, begin with the largest n that
gives 28 frames/s. A larger one is chosen only where frames take too long for that anyway, and where
even ones are hardly fewer: a frame every 67 ms, rather than after 50, 67 or 83 ms because each
takes 60.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

# between frames: n is not raised beyond it without need, so that no slow source becomes slower
SLOWEST_S = 1 / 28
# between even frames beyond that, over uneven ones: to begin with n, and to keep it
MORE_TIME = 1.25
MAX_TIME = 1.35
# over which it is seen that frames take too long, and the least number of them
RECENT_S = 1.0
FEWEST = 8
IN_TIME_S = 4.0  # the same, that they would be processed in time with a lower n
# of the frames in these times, that take too long
LATE_SHARE = 0.15
RARE_SHARE = 0.08
# distance of the source's frames, over that for which n was chosen, from which n is chosen anew
SLOWER = 1.5
# of the time between two frames, which all but a few have to leave some of for n to be lowered
MAX_BUSY_SHARE = 0.8
_INTERVALS = 31  # of the source, whose median counts


class Pace:
    """Decides by the times that frames take, and by those of all frames, processed or not."""

    def __init__(self) -> None:
        self.every: int | None = None  # n; None before the frames' distance in time is known
        self._intervals: deque[float] = deque(maxlen=_INTERVALS)
        self._came_s: float | None = None
        self._taken_s: float | None = None
        self._chosen_for_s = 0.0  # between the source's frames when n was chosen
        # frame times and seconds, since n was changed
        self._took: deque[tuple[float, float]] = deque()

    def is_due(self, time_s: float) -> bool:
        """Note that a frame came, and return whether it may be processed.

        :param time_s: of the frame, later than the one before.
        """
        if self._came_s is not None:
            self._intervals.append(time_s - self._came_s)
        self._came_s = time_s
        if self.every is None and len(self._intervals) >= FEWEST:
            self._change(self._most)
        if self._taken_s is None or self.every is None or self.every == 1:
            return True
        return time_s - self._taken_s > (self.every - 0.5) * self._interval_s

    def take(self, time_s: float) -> None:
        """Note that the frame of this time is processed now."""
        self._taken_s = time_s

    def add_duration(self, seconds: float) -> None:
        """Note how long the frame took that was taken last, and choose n."""
        if self._taken_s is None or self.every is None:
            return
        self._took.append((self._taken_s, seconds))
        while self._took[0][0] < self._taken_s - IN_TIME_S:
            self._took.popleft()
        if self.every > self._most and not self._is_worth_it():
            self._change(self._most)
        elif self._share_above(self.every * self._interval_s, RECENT_S) > LATE_SHARE:
            self._raise()
        elif self._took[-1][0] - self._took[0][0] > IN_TIME_S - 2 * SLOWEST_S:
            for every in range(1, self.every):
                if (
                    self._share_above(MAX_BUSY_SHARE * every * self._interval_s, IN_TIME_S)
                    < RARE_SHARE
                ):
                    self._change(every)
                    return

    def _raise(self) -> None:
        """Choose a larger n, if there is one for which enough frames are processed in time, and
        still many.
        """
        assert self.every is not None
        if self.every < self._most:
            self._change(self.every + 1)
            return
        every = self.every + 1
        while self._costs_little(every, MORE_TIME, RECENT_S):
            if self._share_above(every * self._interval_s, RECENT_S) <= LATE_SHARE:
                self._change(every)
                return
            every += 1

    def _is_worth_it(self) -> bool:
        """Return whether an n beyond what is needed for 28 frames/s still serves its purpose, as
        far as is known.
        """
        assert self.every is not None
        if self._interval_s > SLOWER * self._chosen_for_s:
            return False
        return len(self._recent(IN_TIME_S)) < FEWEST or self._costs_little(
            self.every, MAX_TIME, IN_TIME_S
        )

    def _costs_little(self, every: int, more_time: float, recent_s: float) -> bool:
        """Return whether every n-th frame takes hardly more time than whichever frames could be
        processed.
        """
        uneven_s = float(np.maximum(self._recent(recent_s), self._most * self._interval_s).mean())
        return every * self._interval_s <= more_time * uneven_s

    def _change(self, every: int) -> None:
        self.every = every
        self._chosen_for_s = self._interval_s
        self._took.clear()

    @property
    def _most(self) -> int:
        """The largest n without need."""
        return max(int(SLOWEST_S / self._interval_s), 1)

    @property
    def _interval_s(self) -> float:
        return float(np.median(self._intervals))

    def _share_above(self, seconds: float, recent_s: float) -> float:
        """Return the share of the last frames that took longer; 0 where there are too few to
        tell.
        """
        took = self._recent(recent_s)
        return float(np.mean(took > seconds)) if len(took) >= FEWEST else 0.0

    def _recent(self, recent_s: float) -> NDArray[np.float64]:
        """Return how long the last frames took."""
        return np.array(
            [each for time_s, each in self._took if time_s >= self._took[-1][0] - recent_s]
        )
