# SPDX-License-Identifier: GPL-3.0-or-later
"""The range of frames to capture: start, end and frame rate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from ...errors import UsageError
from .frame import Frame
from .timecode import Timecode, parse_time

_MARGIN = Fraction(1, 4)  # of a frame, for containers that round the times of their frames


@dataclass(frozen=True)
class VideoRange:
    """Frames shown from ``start_s`` to ``end_s``, both included: ``fps`` of them per second, or all if None.

    :raises UsageError: start, end or rate is out of range, or the end does not come after the start.
    """

    start_s: float = 0.0
    end_s: float = float("inf")
    fps: Fraction | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.start_s < float("inf"):
            raise UsageError(f"the start must be 0 s or later, but is {self.start_s} s")
        if not self.end_s > self.start_s:
            raise UsageError(f"the end ({self.end_s:g} s) must come after the start ({self.start_s:g} s)")
        if self.fps is not None and not 0 < self.fps <= 1000:
            raise UsageError(f"frames per second must be above 0 and at most 1000, but are {float(self.fps):g}")

    def at_rate(self, fps: Fraction) -> VideoRange:
        """Return the range itself: times in seconds do not depend on the rate."""
        return self


@dataclass(frozen=True)
class TimecodeRange:
    """A range whose start or end may be a timecode, which has a time in seconds only at a given rate."""

    start: float | Timecode = 0.0
    end: float | Timecode = float("inf")
    fps: Fraction | None = None

    def at_rate(self, fps: Fraction) -> VideoRange:
        """Convert to seconds, in footage of this rate.

        :raises UsageError: a timecode does not exist at this rate, or the end does not come after the start.
        """
        start, end = self.start, self.end
        if isinstance(start, Timecode):
            start = max(0.0, float((start.frame(fps) - _MARGIN) / fps))
        if isinstance(end, Timecode):
            end = float((end.frame(fps) + _MARGIN) / fps)
        return VideoRange(start, end, self.fps)


FootageRange = VideoRange | TimecodeRange


class FrameSampler:
    """Samples frames at a constant rate: those nearest to t₀ + k / fps, t₀ the time of the first, each at most once.

    :param fps: frames per second to keep, or None for all.
    """

    def __init__(self, fps: Fraction | None) -> None:
        self._fps = fps
        self._start: float | None = None
        self._next = 0  # k of the next sample
        self._waiting: Frame | None = None

    def add(self, frame: Frame) -> Iterator[Frame]:
        """Add the next frame; yield the samples that are known from it."""
        if self._fps is None:
            yield frame
            return
        if self._start is None:
            self._start, self._next = frame.timestamp_s, 1
            yield frame
            return
        due = self._start + float(self._next / self._fps)
        if frame.timestamp_s < due:
            self._waiting = frame
            return
        before, self._waiting = self._waiting, None
        if before is not None and due - before.timestamp_s < frame.timestamp_s - due:
            self._skip_past(before.timestamp_s)
            yield before
            yield from self.add(frame)
            return
        self._skip_past(frame.timestamp_s)
        yield frame

    def flush(self) -> Iterator[Frame]:
        """Yield the last frame, if it is less than half a step before the next sample's time."""
        if self._waiting is not None and self._fps is not None and self._start is not None:
            due = self._start + float(self._next / self._fps)
            if due - self._waiting.timestamp_s < 0.5 / float(self._fps):
                yield self._waiting
            self._waiting = None

    def _skip_past(self, time: float) -> None:
        """Advance to the first sample time that is nearer to a later frame than to this one's."""
        assert self._start is not None
        assert self._fps is not None
        self._next = max(self._next + 1, int((time - self._start) * float(self._fps) + 0.5) + 1)


def parse_range(start: str | None, end: str | None, fps: str | None) -> FootageRange:
    """Parse the arguments of ``--start``, ``--end`` and ``--fps``.

    :param start: None: from the beginning.
    :param end: None: to the end.
    :param fps: None: all frames.
    :raises UsageError: one of them is not a time or a rate, or the end does not come after the start.
    """
    first = 0.0 if start is None else parse_time(start)
    last = float("inf") if end is None else parse_time(end)
    rate = None if fps is None else parse_rate(fps)
    if isinstance(first, Timecode) or isinstance(last, Timecode):
        return TimecodeRange(first, last, rate)
    return VideoRange(first, last, rate)


def parse_rate(text: str) -> Fraction:
    """Parse frames per second: "25", "30000/1001", or "29.97", which stands for 30000/1001 (likewise 23.976 etc.).

    :raises UsageError: the text is not a positive number of at most 1000.
    """
    try:
        rate = Fraction(text.strip())
    except (ValueError, ZeroDivisionError):
        rate = Fraction(0)
    if not 0 < rate <= 1000:
        raise UsageError(f"{text!r} is not a frame rate; give frames per second, such as 25, 29.97 or 30000/1001")
    standard = Fraction(round(rate * 1001 / 1000) * 1000, 1001)
    return standard if rate != standard and abs(rate - standard) < Fraction(1, 200) and rate.denominator > 1 else rate
