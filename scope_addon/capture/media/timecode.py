# SPDX-License-Identifier: GPL-3.0-or-later
"""Parses times: seconds, MM:SS, HH:MM:SS.mmm, and timecode HH:MM:SS:FF or HH:MM:SS;FF.

A timecode counts frames at the nominal rate r, the integer nearest to the footage's rate (30 for 30000/1001). With a
semicolon it is drop-frame timecode (SMPTE ST 12-1), for 29.97 and 59.94 frames per second: to stay in step with the
clock, it omits the first d = r / 15 numbers of each minute, except of every tenth minute,

    frame = r (3600 h + 60 m + s) + f − d (M − ⌊M / 10⌋),    M = 60 h + m

Both count from the first frame of the footage; a timecode that the camera recorded is ignored.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction

from ...errors import UsageError

_CLOCK = re.compile(r"(?:(?:(\d{1,4}):)?(\d{1,2}):)?(\d{1,9}(?:[.,]\d*)?|(?<!:)[.,]\d+)", re.A)
_FRAMES = re.compile(r"(\d{1,4})([:;])(\d\d)([:;])(\d\d)([:;])(\d{2,3})", re.A)
_SEPARATORS = (":::", "::;", ";;;")  # some editors write drop-frame timecode like the last
_DROP_RATES = (30, 60)
_NEAR_NOMINAL = Fraction(1, 100)  # relative tolerance: phones report a rate averaged over the file
_SAME_RATE = Fraction(1, 10_000)  # relative tolerance of 29.97 against 30000/1001; 30 differs ten times as much


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
            raise UsageError(f"{self} has no meaning at {float(fps):.5g} frames per second; give the time in seconds")
        if self.frames >= rate:
            raise UsageError(
                f"{self} does not exist: at {float(fps):.5g} frames per second, frame numbers go up to {rate - 1}"
            )
        number = rate * (3600 * self.hours + 60 * self.minutes + self.seconds) + self.frames
        if not self.drop_frame:
            return number
        if rate not in _DROP_RATES or abs(fps - Fraction(rate * 1000, 1001)) > _SAME_RATE * rate:
            raise UsageError(
                f"{self} is drop-frame timecode, which is for 29.97 and 59.94 frames per second, and the footage has "
                f"{float(fps):.5g}; write a colon before the frames"
            )
        dropped, minute = rate // 15, 60 * self.hours + self.minutes
        if self.minutes % 10 and self.seconds == 0 and self.frames < dropped:
            raise UsageError(
                f"{self} does not exist: drop-frame timecode omits the first {dropped} frame numbers of this minute; "
                f"the first one is {dropped:02}"
            )
        return number - dropped * (minute - minute // 10)


def parse_time(text: str) -> float | Timecode:
    """Parse "12.5", "MM:SS", "MM:SS.mmm", "HH:MM:SS" or "HH:MM:SS.mmm" to seconds, and "HH:MM:SS:FF" to a timecode.

    :raises UsageError: the text has none of these forms, or minutes or seconds are 60 or more.
    """
    if match := _FRAMES.fullmatch(text.strip()):
        hours, first, minutes, second, seconds, third, frames = match.groups()
        if first + second + third in _SEPARATORS:
            _check_sixty(text, int(minutes), int(seconds))
            return Timecode(int(hours), int(minutes), int(seconds), int(frames), drop_frame=third == ";")
    match = _CLOCK.fullmatch(text.strip())
    if match is None:
        raise UsageError(
            f"{text!r} is not a valid time; give seconds (12.5), MM:SS, HH:MM:SS.mmm or a timecode "
            "(HH:MM:SS:FF, HH:MM:SS;FF)"
        )
    hours, minutes, seconds = match.groups()
    value = float(seconds.replace(",", "."))
    _check_sixty(text, int(minutes or 0) if hours is not None else 0, value if minutes is not None else 0)
    return 3600.0 * int(hours or 0) + 60.0 * int(minutes or 0) + value


def _check_sixty(text: str, minutes: float, seconds: float) -> None:
    if minutes >= 60 or seconds >= 60:
        raise UsageError(f"{text!r} is not a valid time: minutes and seconds go up to 59")
