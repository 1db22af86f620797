# SPDX-License-Identifier: GPL-3.0-or-later
"""The progress of a job: completed fraction, frames per second, remaining time."""

from __future__ import annotations

import time
from collections.abc import Callable

from ..capture.stages.clock import COMPILING

# Share of the total time that each stage of a capture takes, in order; measured on clips of 10 to 40 seconds.
STAGES = {
    "starting": 0.02,
    "finding the person": 0.56,
    "finding the shape": 0.08,
    "solving": 0.16,
    "solving on the floor": 0.16,
    "writing": 0.02,
}


# Stages that only the first capture after installation has; they take none of the others' shares.
FIRST_ONLY = (COMPILING,)


class JobProgress:
    """Convert the worker's progress messages to what the panel shows."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin at 0.

        :param clock: returns the time in seconds.
        """
        self._clock = clock
        self._start = self._stage_start = clock()
        self._stage_first = 0  # frames done when the stage began
        self.stage, self.done, self.total = "starting", 0, 0
        self.fraction = 0.0  # of the whole job, 0..1; it never decreases, although stages repeat for each person

    def update(self, stage: str, done: int, total: int) -> None:
        """Take one progress message of the worker: ``done`` of ``total``, which is 0 if unknown."""
        if stage != self.stage:
            if self.stage in FIRST_ONLY:  # the time left follows from the other stages' speed
                self._start += self._clock() - self._stage_start
            self.stage, self._stage_start, self._stage_first = stage, self._clock(), done
        self.done, self.total = done, total
        self.fraction = max(self.fraction, self._fraction_at_stage())

    def _fraction_at_stage(self) -> float:
        """Return the completed fraction of the job. A stage without a total counts as not begun."""
        if self.stage not in STAGES:
            return 0.0
        names = list(STAGES)
        before = sum(STAGES[n] for n in names[: names.index(self.stage)])
        within = min(1.0, self.done / self.total) if self.total > 0 else 0.0
        return min(1.0, before + STAGES[self.stage] * within)

    @property
    def frames_per_second(self) -> float | None:
        """Speed of the current stage; None until it can be measured."""
        elapsed, frames = self._clock() - self._stage_start, self.done - self._stage_first
        is_measured = self.total > 1 and frames > 0 and elapsed > 0.5 and self.stage not in FIRST_ONLY
        return frames / elapsed if is_measured else None

    @property
    def seconds_left(self) -> float | None:
        """Estimated remaining time of the job; None until it can be estimated."""
        elapsed, fraction = self._clock() - self._start, self.fraction
        if elapsed < 2 or fraction < 0.05 or self.total == 0 or self.stage in FIRST_ONLY:
            return None
        return elapsed * (1 - fraction) / fraction

    def lines(self, translate: Callable[[str], str] = str) -> list[str]:
        """Return the lines to show: the stage, and speed and remaining time if they are known.

        :param translate: returns a text in the user's language, with the same placeholders.
        """
        stage = translate(self.stage.capitalize())
        if self.stage in FIRST_ONLY:
            stage = translate("{stage} (first capture only)").format(stage=stage)
        if self.total > 0:
            stage = translate("{stage}, {done} of {total}").format(stage=stage, done=self.done, total=self.total)
        lines = [stage]
        speed, left = [], []
        if rate := self.frames_per_second:
            speed = [translate("{rate:.1f} frames/s").format(rate=rate)]
        if self.seconds_left is not None:
            left = [translate("{time} left").format(time=duration(self.seconds_left))]
        if speed or left:
            lines.append(", ".join(speed + left))
        return lines


def duration(seconds: float) -> str:
    """Format a duration: ``45 s``, ``3 min 05 s``, ``1 h 02 min``."""
    seconds = max(0, round(seconds))
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60:02d} s"
    return f"{seconds // 3600} h {seconds % 3600 // 60:02d} min"
