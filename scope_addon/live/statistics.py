# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast and how late the poses of a live capture come."""

from __future__ import annotations

from collections import deque

import numpy as np

RECENT_S = 2.0  # over which the rate is shown
MAX_LATENCIES = 100_000  # the last hour at 28 poses/s


class Statistics:
    """Counts poses; times are seconds of the capture's clock."""

    def __init__(self) -> None:
        self._given: deque[float] = deque()
        self._latencies: deque[float] = deque(maxlen=MAX_LATENCIES)
        self.poses = 0
        self._first_s = self._last_s = 0.0

    def add(self, arrived_s: float, now_s: float) -> float:
        """Count a pose and return its latency in milliseconds.

        :param arrived_s: when its frame came, or was due.
        :param now_s: when the pose was known.
        """
        self._first_s = self._first_s if self.poses else now_s
        self._last_s = now_s
        self.poses += 1
        self._given.append(now_s)
        while self._given[0] < now_s - RECENT_S:
            self._given.popleft()
        latency_ms = 1000 * (now_s - arrived_s)
        self._latencies.append(latency_ms)
        return latency_ms

    @property
    def recent_rate(self) -> float:
        """Poses per second in the last seconds."""
        length = self._given[-1] - self._given[0] if len(self._given) > 1 else 0.0
        return (len(self._given) - 1) / length if length > 0 else 0.0

    @property
    def rate(self) -> float:
        """Poses per second since the first one."""
        length = self._last_s - self._first_s
        return (self.poses - 1) / length if length > 0 else 0.0

    def latency_ms(self) -> tuple[float, float]:
        """Return the median and the 95th percentile in milliseconds; zeros before the first
        pose.
        """
        if not self._latencies:
            return 0.0, 0.0
        median, p95 = np.percentile(self._latencies, [50, 95])
        return float(median), float(p95)
