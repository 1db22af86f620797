# SPDX-License-Identifier: GPL-3.0-or-later
"""The stages of a capture: their progress, and the time spent in each."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

FINDING = "finding the person"  # a stage, in which the footage is decoded and observed
# A stage of the first capture on a computer for which no machine code is shipped.
COMPILING = "compiling the solver"
PLACING = "placing the cameras"  # of several cameras alone
# Called with the stage's name, the steps done and the total (0: unknown). May raise CancelledError.
Progress = Callable[[str, int, int], None]


class StageClock:
    """Adds up the seconds of each stage; of stages in other threads, only the time that the main
    thread waited for.
    """

    def __init__(self) -> None:
        """Start with no stage."""
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Count the time within the context as this stage's."""
        since = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - since

    def rates(self, frames: int) -> dict[str, float]:
        """Return the frames per second of each stage and of all together (``total``)."""
        seconds = dict(self.seconds, total=sum(self.seconds.values()))
        return {name: round(frames / max(s, 1e-9), 2) for name, s in seconds.items()}
