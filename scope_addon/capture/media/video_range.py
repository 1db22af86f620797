# SPDX-License-Identifier: GPL-3.0-or-later
"""The range of frames to capture: start, end and frame rate; and how they have to be turned.

Times are seconds, MM:SS, HH:MM:SS.mmm, or timecode HH:MM:SS:FF or HH:MM:SS;FF. A timecode counts
frames at the nominal rate r, the integer nearest to the footage's rate (30 for 30000/1001). With a
semicolon it is drop-frame timecode (SMPTE ST 12-1), for 29.97 and 59.94 frames per second: to stay
in step with the clock, it omits the first d = r / 15 numbers of each minute, except of every tenth
minute,

    frame = r (3600 h + 60 m + s) + f − d (M − ⌊M / 10⌋),    M = 60 h + m

Both count from the first frame of the footage; a timecode that the camera recorded is ignored.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from ...errors import UsageError
from ...footage_view import AS_IN_FILE, FootageView
from .frame import Frame

_SAME_S = 1e-6  # by which times of frames are rounded
_MARGIN = Fraction(1, 4)  # of a frame, for containers that round the times of their frames
_CLOCK = re.compile(r"(?:(?:(\d{1,4}):)?(\d{1,2}):)?(\d{1,9}(?:[.,]\d*)?|(?<!:)[.,]\d+)", re.A)
_FRAMES = re.compile(r"(\d{1,4})([:;])(\d\d)([:;])(\d\d)([:;])(\d{2,3})", re.A)
_SEPARATORS = (":::", "::;", ";;;")  # some editors write drop-frame timecode like the last
_DROP_RATES = (30, 60)
_NEAR_NOMINAL = Fraction(1, 100)  # relative tolerance: phones report a rate averaged over the file
_RATE = re.compile(r"\d{1,9}(\.\d{1,9})?(/\d{1,9})?", re.A)
# Relative tolerance of 29.97 against 30000/1001; 30 differs ten times as much.
_SAME_RATE = Fraction(1, 10_000)


@dataclass(frozen=True)
class VideoRange:
    """Frames shown from ``start_s`` to ``end_s``, both included: ``fps`` of them per second, or all
    if None; seen as ``view`` says.

    :raises UsageError: start, end or rate is out of range, or the end does not come after the
        start.
    """

    start_s: float = 0.0
    end_s: float = float("inf")
    fps: Fraction | None = None
    view: FootageView = AS_IN_FILE

    def __post_init__(self) -> None:
        if not 0 <= self.start_s < float("inf"):
            raise UsageError(f"the start must be 0 s or later, but is {self.start_s} s")
        if not self.end_s > self.start_s:
            raise UsageError(
                f"the end ({self.end_s:g} s) must come after the start ({self.start_s:g} s)"
            )
        if self.fps is not None and not 0 < self.fps <= 1000:
            raise UsageError(
                f"frames per second must be above 0 and at most 1000, but are {float(self.fps):g}"
            )

    def at_rate(self, fps: Fraction) -> VideoRange:
        """Return the range itself: times in seconds do not depend on the rate."""
        return self


@dataclass(frozen=True)
class TimecodeRange:
    """A range whose start or end may be a timecode, which has a time in seconds only at a given
    rate.
    """

    start: float | Timecode = 0.0
    end: float | Timecode = float("inf")
    fps: Fraction | None = None
    view: FootageView = AS_IN_FILE

    def at_rate(self, fps: Fraction) -> VideoRange:
        """Convert to seconds, in footage of this rate.

        :raises UsageError: a timecode does not exist at this rate, or the end does not come after
            the start.
        """
        start = self.start
        end = self.end
        if isinstance(start, Timecode):
            start = max(0.0, float((start.frame(fps) - _MARGIN) / fps))
        if isinstance(end, Timecode):
            end = float((end.frame(fps) + _MARGIN) / fps)
        return VideoRange(start, end, self.fps, self.view)


FootageRange = VideoRange | TimecodeRange


class FrameSampler:
    """Samples frames at a constant rate: those nearest to t₀ + k / fps, t₀ the time of the first,
    each at most once.

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
            self._start = frame.timestamp_s
            self._next = 1
            yield frame
            return
        due = self._start + float(self._next / self._fps)
        if frame.timestamp_s < due:
            self._waiting = frame
            return
        before = self._waiting
        self._waiting = None
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
            if due - self._waiting.timestamp_s < 0.5 / float(self._fps) - _SAME_S:
                yield self._waiting
            self._waiting = None

    def _skip_past(self, time: float) -> None:
        """Advance to the first sample time that is nearer to a later frame than to this one's."""
        assert self._start is not None
        assert self._fps is not None
        self._next = max(self._next + 1, int((time - self._start) * float(self._fps) + 0.5) + 1)


def parse_range(
    start: str | None,
    end: str | None,
    fps: str | None,
    *,
    view: FootageView = AS_IN_FILE,
) -> FootageRange:
    """Parse the arguments of ``--start``, ``--end`` and ``--fps``.

    :raises UsageError: one of them is not a time or a rate, or the end does not come after the
        start.
    """
    first = 0.0 if start is None else parse_time(start)
    last = float("inf") if end is None else parse_time(end)
    rate = None if fps is None else parse_rate(fps)
    if isinstance(first, Timecode) or isinstance(last, Timecode):
        return TimecodeRange(first, last, rate, view)
    return VideoRange(first, last, rate, view)


def parse_rate(text: str) -> Fraction:
    """Parse frames per second: "25", "30000/1001", or "29.97", which stands for 30000/1001
    (likewise 23.976 etc.).

    :raises UsageError: the text is not a positive number of at most 1000.
    """
    try:  # of an exponent, a fraction computes all digits
        rate = Fraction(text.strip()) if _RATE.fullmatch(text.strip()) else Fraction(0)
    except (ValueError, ZeroDivisionError):
        rate = Fraction(0)
    if not 0 < rate <= 1000:
        raise UsageError(
            f"{text!r} is not a frame rate; give frames per second, such as 25, 29.97 or 30000/1001"
        )
    standard = Fraction(round(rate * 1001 / 1000) * 1000, 1001)
    return (
        standard
        if rate != standard and abs(rate - standard) < Fraction(1, 200) and rate.denominator > 1
        else rate
    )


@dataclass(frozen=True)
class Timecode:
    """A timecode HH:MM:SS:FF; ``drop_frame``: it was written with a semicolon."""

    hours: int
    minutes: int
    seconds: int
    frames: int
    drop_frame: bool

    def __str__(self) -> str:
        """Format as HH:MM:SS:FF or HH:MM:SS;FF."""
        before_frames = ";" if self.drop_frame else ":"
        return f"{self.hours:02}:{self.minutes:02}:{self.seconds:02}{before_frames}{self.frames:02}"

    def frame(self, fps: Fraction) -> int:
        """Convert to the index of the frame, from 0, in footage of this rate.

        :raises UsageError: the timecode does not exist at this rate.
        """
        rate = round(fps)
        if abs(fps - rate) > _NEAR_NOMINAL * rate:
            raise UsageError(
                f"{self} has no meaning at {float(fps):.5g} frames per second; give "
                "the time in seconds"
            )
        if self.frames >= rate:
            raise UsageError(
                f"{self} does not exist: at {float(fps):.5g} frames per second, frame numbers go "
                f"up to {rate - 1}"
            )
        number = rate * (3600 * self.hours + 60 * self.minutes + self.seconds) + self.frames
        if not self.drop_frame:
            return number
        if rate not in _DROP_RATES or abs(fps - Fraction(rate * 1000, 1001)) > _SAME_RATE * rate:
            raise UsageError(
                f"{self} is drop-frame timecode, which is for 29.97 and 59.94 frames per second, "
                f"and the footage has {float(fps):.5g}; write a colon before the frames"
            )
        dropped = rate // 15
        minute = 60 * self.hours + self.minutes
        if self.minutes % 10 and self.seconds == 0 and self.frames < dropped:
            raise UsageError(
                f"{self} does not exist: drop-frame timecode omits the first {dropped} frame "
                f"numbers of this minute; the first one is {dropped:02}"
            )
        return number - dropped * (minute - minute // 10)


def parse_time(text: str) -> float | Timecode:
    """Parse "12.5", "MM:SS", "MM:SS.mmm", "HH:MM:SS" or "HH:MM:SS.mmm" to seconds, and
    "HH:MM:SS:FF" to a timecode.

    :raises UsageError: the text has none of these forms, or minutes or seconds are 60 or more.
    """
    if match := _FRAMES.fullmatch(text.strip()):
        hours, first, minutes, second, seconds, third, frames = match.groups()
        if first + second + third in _SEPARATORS:
            _check_sixty(text, int(minutes), int(seconds))
            return Timecode(
                int(hours), int(minutes), int(seconds), int(frames), drop_frame=third == ";"
            )
    match = _CLOCK.fullmatch(text.strip())
    if match is None:
        raise UsageError(
            f"{text!r} is not a valid time; give seconds (12.5), MM:SS, HH:MM:SS.mmm or a timecode "
            "(HH:MM:SS:FF, HH:MM:SS;FF)"
        )
    hours, minutes, seconds = match.groups()
    value = float(seconds.replace(",", "."))
    _check_sixty(
        text, int(minutes or 0) if hours is not None else 0, value if minutes is not None else 0
    )
    return 3600.0 * int(hours or 0) + 60.0 * int(minutes or 0) + value


def _check_sixty(text: str, minutes: float, seconds: float) -> None:
    if minutes >= 60 or seconds >= 60:
        raise UsageError(f"{text!r} is not a valid time: minutes and seconds go up to 59")
