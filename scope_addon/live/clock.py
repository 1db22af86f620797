# SPDX-License-Identifier: GPL-3.0-or-later
"""The time that a live capture runs by; tests replace it."""

from __future__ import annotations

import threading
import time


class Clock:
    """Monotonic seconds, and sleep that ends early when the capture stops."""

    def __init__(self) -> None:
        self.stopped = threading.Event()

    def now(self) -> float:
        """Return the time in seconds since an arbitrary moment."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait, but not after ``stopped`` is set."""
        if seconds > 0:
            self.stopped.wait(seconds)
