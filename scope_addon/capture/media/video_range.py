# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frames of a video are wanted: from when, until when, and how many a second."""

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
    """Frames shown from ``start_s`` to ``end_s``, both included; of these, ``fps`` a second, or all."""

    start_s: float = 0.0
    end_s: float = float("inf")
    fps: Fraction | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.start_s < float("inf"):
            raise UsageError(f"the start must be a time from 0 on, but is {self.start_s} s")
        if not self.end_s > self.start_s:
            raise UsageError(f"the end ({self.end_s:g} s) must come after the start ({self.start_s:g} s)")
        if self.fps is not None and not 0 < self.fps <= 1000:
            raise UsageError(f"frames per second must be above 0 and at most 1000, but are {float(self.fps):g}")

    def at_rate(self, fps: Fraction) -> VideoRange:
        """Itself: seconds are the same at any rate."""
        return self

    def chooser(self) -> FrameChooser:
        """A new choice of frames, for one pass over the video."""
        return FrameChooser(self.fps)


@dataclass(frozen=True)
class TimecodeRange:
    """As `VideoRange`, but an end that is a timecode means a frame, whose time follows from the footage's rate."""

    start: float | Timecode = 0.0
    end: float | Timecode = float("inf")
    fps: Fraction | None = None

    def at_rate(self, fps: Fraction) -> VideoRange:
        """The same in footage of this rate.

        :raises UsageError: there is no such timecode at this rate, or the end does not come after the start.
        """
        start, end = self.start, self.end
        if isinstance(start, Timecode):
            start = max(0.0, float((start.frame(fps) - _MARGIN) / fps))
        if isinstance(end, Timecode):
            end = float((end.frame(fps) + _MARGIN) / fps)
        return VideoRange(start, end, self.fps)


FootageRange = VideoRange | TimecodeRange


class FrameChooser:
    """Of frames in order, those nearest to a grid of times t₀ + k / fps, t₀ the first frame's; each at most once."""

    def __init__(self, fps: Fraction | None) -> None:
        self._fps = fps
        self._start: float | None = None
        self._next = 0  # number of the grid's time that is served next
        self._waiting: Frame | None = None

    def choose(self, frame: Frame) -> Iterator[Frame]:
        """What is chosen now that this frame has come."""
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
            yield from self.choose(frame)
            return
        self._skip_past(frame.timestamp_s)
        yield frame

    def rest(self) -> Iterator[Frame]:
        """The last frame, where the grid's next time lies nearer to it than half a step."""
        if self._waiting is not None and self._fps is not None and self._start is not None:
            due = self._start + float(self._next / self._fps)
            if due - self._waiting.timestamp_s < 0.5 / float(self._fps):
                yield self._waiting
            self._waiting = None

    def _skip_past(self, time: float) -> None:
        """To the first time of the grid that is nearer to a later frame than to this one's."""
        assert self._start is not None
        assert self._fps is not None
        self._next = max(self._next + 1, int((time - self._start) * float(self._fps) + 0.5) + 1)


def parse_range(start: str | None, end: str | None, fps: str | None) -> FootageRange:
    """What ``--start``, ``--end`` and ``--fps`` say; None: from the beginning, to the end, all frames.

    :raises UsageError: one of them is none, or the end does not come after the start.
    """
    first = 0.0 if start is None else parse_time(start)
    last = float("inf") if end is None else parse_time(end)
    rate = None if fps is None else parse_rate(fps)
    if isinstance(first, Timecode) or isinstance(last, Timecode):
        return TimecodeRange(first, last, rate)
    return VideoRange(first, last, rate)


def parse_rate(text: str) -> Fraction:
    """Frames per second of "25", "29.97", "30000/1001"; 29.97 and its like mean the rational of the video standards.

    :raises UsageError: it is no positive number.
    """
    try:
        rate = Fraction(text.strip())
    except (ValueError, ZeroDivisionError):
        rate = Fraction(0)
    if not 0 < rate <= 1000:
        raise UsageError(f"{text!r} is no frame rate; give frames per second, such as 25, 29.97 or 30000/1001")
    standard = Fraction(round(rate * 1001 / 1000) * 1000, 1001)
    return standard if rate != standard and abs(rate - standard) < Fraction(1, 200) and rate.denominator > 1 else rate
