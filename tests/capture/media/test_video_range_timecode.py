# SPDX-License-Identifier: GPL-3.0-or-later
"""Times and timecodes against a counter that steps through every label, and the hour of the SMPTE
standard.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import pytest
from scope.scope_addon.capture.media.video_range import Timecode, parse_time
from scope.scope_addon.errors import UsageError


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        *(("0", 0), ("12.5", 12.5), (".5", 0.5), ("90", 90), ("01:30", 90), ("1:02:03", 3723)),
        *(("00:00:01.250", 1.25), ("1:00,5", 60.5)),
    ],
)
def test_times(text: str, seconds: float) -> None:
    assert parse_time(text) == pytest.approx(seconds)


NO_TIMES = [
    "",
    ".",
    "1:.5",
    "-1",
    "1:60",
    "1:60:00",
    "one",
    "1:2:3:4",
    "nan",
    "1:02:60:00",
    "1;02:03;04",
    "1:02:03;4",
]


@pytest.mark.parametrize("text", [*NO_TIMES, "9" * 9999, "9" * 9999 + ":00:00:00"])
def test_invalid_times_are_refused(text: str) -> None:
    with pytest.raises(UsageError):
        parse_time(text)


def timecode(text: str) -> Timecode:
    got = parse_time(text)
    assert isinstance(got, Timecode)
    return got


def labels(rate: int, dropped: int) -> Iterator[str]:
    """Iterate over the timecodes of 21 minutes, without the first ``dropped`` of each minute except
    every tenth.
    """
    for minute in range(21):
        for second in range(60):
            for frame in range(rate):
                if not (minute % 10 and second == 0 and frame < dropped):
                    yield f"00:{minute:02}:{second:02}{';' if dropped else ':'}{frame:02}"


@pytest.mark.parametrize(
    ("fps", "rate", "dropped"),
    [
        (Fraction(30000, 1001), 30, 2),
        (Fraction(60000, 1001), 60, 4),
        (Fraction(2997, 100), 30, 2),
        (Fraction(30000, 1001), 30, 0),
        (Fraction(24000, 1001), 24, 0),
        (Fraction(25), 25, 0),
        (Fraction(2999, 100), 30, 0),
    ],
)
def test_consecutive_timecodes_are_consecutive_frames(
    fps: Fraction, rate: int, dropped: int
) -> None:
    for number, text in enumerate(labels(rate, dropped)):
        if number % 7 == 0 or ":00" in text[-6:]:
            assert timecode(text).frame(fps) == number, text


def test_an_hour_of_drop_frame_timecode_is_an_hour() -> None:
    assert timecode("01:00:00;00").frame(Fraction(30000, 1001)) == 107892
    assert timecode("01;00;00;00").frame(Fraction(60000, 1001)) == 215784
    assert timecode("01:00:00:00").frame(Fraction(30000, 1001)) == 108000


@pytest.mark.parametrize(
    ("text", "fps", "says"),
    [
        ("00:01:00;01", Fraction(30000, 1001), "first one is 02"),
        ("00:11:00;03", Fraction(60000, 1001), "first one is 04"),
        ("00:00:01;00", Fraction(30), "29.97 and 59.94"),
        ("00:00:01;00", Fraction(24000, 1001), "29.97 and 59.94"),
        ("00:00:01:25", Fraction(25), "up to 24"),
        ("00:00:01:00", Fraction(25, 2), "in seconds"),
        ("00:00:01:00", Fraction(1, 4), "in seconds"),
    ],
)
def test_nonexistent_timecodes_are_refused(text: str, fps: Fraction, says: str) -> None:
    with pytest.raises(UsageError, match=says) as caught:
        timecode(text).frame(fps)
    assert text in str(caught.value)
