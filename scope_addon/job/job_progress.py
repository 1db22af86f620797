# SPDX-License-Identifier: GPL-3.0-or-later
"""The progress of a job: completed fraction, frames per second, remaining time.

The remaining time follows from how long each stage of the last captures of the same kind took.
"""

from __future__ import annotations

import time
from bisect import bisect_right
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..clock import COMPILING, FINDING

# Share of the total time that each stage of a capture takes, in order; measured on clips of 5 to 10
# seconds.
STAGES = {
    "starting": 0.06,
    FINDING: 0.76,
    "finding the shape": 0.07,
    "solving": 0.02,
    "solving the clip": 0.06,
    "solving each frame": 0.02,
    "writing": 0.01,
}


# Stages that only the first capture after installation has; they take none of the others' shares.
FIRST_ONLY = (COMPILING,)
BUILDING = "building the scene"  # after the worker has ended

_SHAPE = "finding the shape"  # the first stage for each person; of several people it says how many
# of a stage, before its speed is believed
_MEASURED_S = 4.0
_MEASURED_STEPS = 12
_STEADY = 1.5  # largest ratio between the speeds of the last two thirds of that time
_MAX_MARKS = 512
_WHAT = "stage times"
_FILE = "times.json"
_SETTINGS = (
    "quality",
    "hands",
    "face",
    "people",
    "body",
    "provider",
    "threads",
)  # on which the time of a frame depends
_MAX_KINDS = 50
_LONGEST_S = 86_400.0  # that a stage may take for a frame


class JobProgress:
    """Convert the worker's progress messages to what the panel shows."""

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        earlier: Mapping[str, float] | None = None,
        *,
        may_compile: bool = False,
    ) -> None:
        """Begin at 0.

        :param clock: returns the time in seconds.
        :param earlier: seconds for each frame of the stages of an earlier capture of the same kind,
            if there was one.
        :param may_compile: whether the solver may have to be compiled after the person was found,
            if there was no earlier capture.
        """
        self._clock = clock
        self._earlier = dict(earlier or {})
        self._may_compile = may_compile and not earlier
        self._stage_start = clock()
        self._stage_first = 0  # frames done when the stage began
        self._marks: list[tuple[float, int]] = []  # of this stage: times, and what was done then
        self._repeated = False  # whether a stage runs a second time
        self._people = 1  # whom the stages after finding them run for, one after the other
        # of each stage: its share that is done, and seconds for it
        self._reached: dict[str, tuple[float, float]] = {}
        self.seconds: dict[str, float] = {}  # of each stage that has ended
        self.frames = 0  # of the footage, as far as known
        self.stage = "starting"
        self.done = 0
        self.total = 0
        # of the whole job, 0..1; it never decreases, although stages repeat for each person
        self.fraction = 0.0

    def update(self, stage: str, done: int, total: int) -> None:
        """Take one progress message of the worker: ``done`` of ``total``, which is 0 if unknown."""
        now = self._clock()
        if stage != self.stage:
            self.seconds[self.stage] = self.seconds.get(self.stage, 0.0) + now - self._stage_start
            self._repeated |= stage in self.seconds and stage in STAGES
            self.stage = stage
            self._stage_start = now
            self._stage_first = done
            self._marks = []
        self.done = done
        self.total = total
        if stage == FINDING:
            self.frames = total
        elif stage == _SHAPE:
            self._people = max(1, total)
        if total > 0:
            self._reached[stage] = (min(1.0, done / total), self._spent(stage))
        self._marks.append((now, done))
        if len(self._marks) > _MAX_MARKS:
            del self._marks[1:-1:2]
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
        elapsed = self._clock() - self._stage_start
        frames = self.done - self._stage_first
        is_measured = (
            self.total > 1 and frames > 0 and elapsed > 0.5 and self.stage not in FIRST_ONLY
        )
        return frames / elapsed if is_measured else None

    @property
    def seconds_left(self) -> float | None:
        """Estimated remaining time of the job; None until it is known to about a half.

        It is what the stage still takes at its own speed, and what those after it took in an
        earlier capture of the same kind, or else their usual part of the time that finding the
        person takes. Of several people, the last stages are less regular: there it may be off by
        another 4 % of the job. Before a stage's first frame, and before the solver was compiled,
        nothing tells what is left.
        """
        if self.stage not in STAGES or self.stage == "starting":
            return None
        if self.stage == FINDING and self._may_compile:
            return None
        names = list(STAGES)
        if self._people > 1 and self.stage != FINDING:
            parts = [self._left_of_everybody(name) for name in names[names.index(FINDING) + 1 :]]
            return None if None in parts else sum(filter(None, parts))
        here = self._left_in_stage()
        if here is None or (self._repeated and not self._earlier):
            return None
        after = [self._expected(name) for name in names[names.index(self.stage) + 1 :]]
        return None if None in after else here + sum(filter(None, after))

    def _spent(self, stage: str) -> float:
        """Return the seconds of a stage so far, for all people."""
        return self.seconds.get(stage, 0.0) + (
            self._clock() - self._stage_start if stage == self.stage else 0.0
        )

    def _left_of_everybody(self, stage: str) -> float | None:
        """Return what a stage still takes for all people: as expected, or as it took for those who
        have it behind them.

        The latter counts only without an earlier capture, which also knows what is done between two
        people.
        """
        done, seconds = self._reached.get(stage, (0.0, 0.0))
        if done * self._people >= 1.0 and not self._earlier:
            return max(0.0, seconds * (1.0 - done) / done - (self._spent(stage) - seconds))
        expected = self._expected(stage)
        return None if expected is None else max(0.0, expected - self._spent(stage))

    def _left_in_stage(self) -> float | None:
        if self.total > 0 and (speed := self._steady_speed()) is not None:
            return max(0, self.total - self.done) / speed
        expected = self._expected(self.stage) if self._earlier and self.stage != FINDING else None
        return (
            None if expected is None else max(0.0, expected - (self._clock() - self._stage_start))
        )

    def _steady_speed(self) -> float | None:
        """Return the speed of the stage in the last third of its time so far; None if it is not
        steady yet.

        The first third does not count: the networks' first frames take longer.
        """
        start, first = self._marks[0] if self._marks else (self._stage_start, 0)
        now = self._clock()
        if now - start < _MEASURED_S or self.done - first < _MEASURED_STEPS:
            return None
        third = (now - start) / 3.0
        marks = [
            self._marks[bisect_right(self._marks, (start + k * third, 1 << 60)) - 1][1]
            for k in (1, 2)
        ]
        before = marks[1] - marks[0]
        after = self.done - marks[1]
        if min(before, after) <= 0 or max(before, after) > _STEADY * min(before, after):
            return None
        return after / third

    def _expected(self, stage: str) -> float | None:
        """Return how long a stage takes for the whole footage; None if that is not known."""
        if self._earlier:
            return self._earlier.get(stage, 0.0) * self.frames
        speed = self._steady_speed() if self.stage == FINDING else None
        if speed is not None:
            finding = self.frames / speed
        elif FINDING in self.seconds:
            finding = self.seconds[FINDING]
        else:
            return None
        return finding * STAGES[stage] / STAGES[FINDING]

    def lines(self, translate: Callable[[str], str] = str) -> list[str]:
        """Return the lines to show: the stage, and speed and remaining time if they are known.

        :param translate: returns a text in the user's language, with the same placeholders.
        """
        stage = translate(self.stage.capitalize())
        if self.stage in FIRST_ONLY:
            stage = translate("{stage} (first capture only)").format(stage=stage)
        if self.total > 0:
            stage = translate("{stage}, {done} of {total}").format(
                stage=stage, done=self.done, total=self.total
            )
        lines = [stage]
        speed = []
        left = []
        if rate := self.frames_per_second:
            speed = [translate("{rate:.1f} frames/s").format(rate=rate)]
        seconds_left = self.seconds_left  # once: a moment later, the estimate may be gone
        if seconds_left is not None:
            left = [translate("{time} left").format(time=duration(seconds_left))]
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


def kind_of(values: Mapping[str, Any]) -> str:
    """Return the kind of a capture with these options: those of one kind take about as long for
    each frame.
    """
    return " ".join(f"{name}={values[name]}" for name in _SETTINGS if name in values)


def load_stage_times(folder: Path, kind: str) -> dict[str, float]:
    """Return the seconds for each frame of every stage of the last capture of a kind; empty if
    there was none.

    :param folder: of the cache.
    """
    times: object = _read(folder).get(kind)
    return dict(times) if isinstance(times, dict) and _are_times(times) else {}


def save_stage_times(folder: Path, kind: str, seconds: Mapping[str, float], frames: int) -> None:
    """Note how long a capture took, if the folder can be written to.

    :param seconds: of each stage, of all frames.
    """
    from ...solver.errors import ScopeError
    from ..json_file import save_map

    if frames < 1:
        return
    kinds = {
        name: times for name, times in _read(folder).items() if name != kind and _are_times(times)
    }
    kinds[kind] = {stage: duration / frames for stage, duration in seconds.items()}
    with suppress(ScopeError, OSError):
        save_map(folder / _FILE, _WHAT, kinds=dict(list(kinds.items())[-_MAX_KINDS:]))


def _read(folder: Path) -> dict[str, Any]:
    from ...solver.errors import ScopeError
    from ..json_file import load_map

    with suppress(ScopeError, OSError):
        kinds = load_map(folder / _FILE, _WHAT).get("kinds")
        return kinds if isinstance(kinds, dict) else {}
    return {}


def _are_times(times: object) -> bool:
    return isinstance(times, dict) and all(
        type(seconds) in (int, float) and 0 <= seconds <= _LONGEST_S for seconds in times.values()
    )
