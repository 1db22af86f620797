# SPDX-License-Identifier: GPL-3.0-or-later
"""Ranges of videos: start, end and frame rate; every frame of the test video shows its own index.

Times and timecodes against a counter that steps through every label, and the hour of the SMPTE
standard.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.frame import Frame
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import (
    FrameSampler,
    Timecode,
    VideoRange,
    parse_range,
    parse_rate,
    parse_time,
)
from scope.scope_addon.errors import UsageError, VideoError

FPS = 25


@pytest.fixture(scope="module")
def long_video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write 60 s at 25 fps with few key frames; 12 black or white squares encode the index of the
    frame.
    """
    path = tmp_path_factory.mktemp("range") / "long.mp4"
    return write_numbers(path, FPS, 60 * FPS, "mp4v")


def write_numbers(path: Path, fps: float, count: int, codec: str) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), fps, (192, 32))
    for number in range(count):
        bits = [(number >> b & 1) * 255 for b in range(12)]
        row = np.repeat(np.array(bits, np.uint8), 16)
        writer.write(np.repeat(np.tile(row, (32, 1))[..., None], 3, axis=2))
    writer.release()
    return path


def shown(frame: Frame) -> int:
    return sum((int(frame.image_rgb[16, 16 * b + 8, 0]) > 127) << b for b in range(12))


@pytest.mark.parametrize(("start", "end"), [(0, 0.5), (3.2, 4.0), (41.36, 42.0), (59.0, 1e9)])
def test_frames_of_a_range_are_those_of_the_whole(
    long_video: Path, start: float, end: float
) -> None:
    with open_video(long_video, VideoRange(start, end)) as video:
        frames = list(video)
        assert video.expected_frames == len(frames)
        assert not video.warnings
    assert [f.index for f in frames] == [
        k for k in range(60 * FPS) if start - 1e-6 <= k / FPS <= end + 1e-6
    ]
    assert [shown(f) for f in frames] == [f.index for f in frames]
    assert [f.timestamp_s for f in frames] == pytest.approx([f.index / FPS for f in frames])


def test_resampled(long_video: Path) -> None:
    with open_video(long_video, VideoRange(1.0, 2.0, Fraction(10))) as video:
        assert video.fps == 10
        assert [f.index for f in video] == pytest.approx(list(np.arange(25, 51, 2.5)), abs=0.5)
    with open_video(long_video, VideoRange(1.0, 2.0, Fraction(60))) as video:
        assert video.fps == FPS
        assert [f.index for f in video] == list(range(25, 51))
        assert "60" in str(video.warnings[0])


@pytest.mark.parametrize("fps", [Fraction(25, 2), Fraction(25, 4), 10, 5])
@pytest.mark.parametrize("start_s", [0.0, 1.0, 7.0])
def test_as_many_frames_are_expected_as_sampled(
    long_video: Path, fps: Fraction, start_s: float
) -> None:
    """Also where the last frame is as near to the last sample as to the next, which is none."""
    for last in range(1, 9):
        wanted = VideoRange(start_s, start_s + last / FPS, Fraction(fps))
        with open_video(long_video, wanted) as video:
            frames = len(list(video))
            steps = Fraction(last) * fps / FPS
            assert video.expected_frames == frames == math.ceil(steps - Fraction(1, 2)) + 1


@pytest.mark.parametrize(("fps", "even"), [(10, 12.5), (20, 25), (24, 25), ("25/2", 0), (25, 0)])
def test_frames_that_are_not_evenly_apart_are_said(
    long_video: Path, fps: int | str, even: float
) -> None:
    with open_video(long_video, VideoRange(1.0, 3.0, Fraction(fps))) as video:
        steps_s = np.diff([frame.timestamp_s for frame in video])
    assert np.allclose(steps_s, float(1 / Fraction(fps)), atol=1e-6) == (even == 0)
    assert [str(each) for each in video.warnings] == [
        f"{long_video.name} has 25 frames per second, so {fps} per second cannot be evenly spaced. "
        "The keys have the exact times of its frames, so some lie between the scene's frames; "
        f"with --fps {even:g} they are evenly spaced"
    ] * (even > 0)


def test_a_start_after_the_end_of_the_video(long_video: Path) -> None:
    with pytest.raises(VideoError, match="60.0 s"):
        open_video(long_video, VideoRange(100))


def test_nearest_frames_of_a_variable_rate() -> None:
    times = [0.0, 0.09, 0.11, 0.3, 0.39, 0.52, 0.6, 0.61]
    sampler = FrameSampler(Fraction(10))
    image = np.zeros((1, 1, 3), np.uint8)
    chosen = [f.timestamp_s for k, t in enumerate(times) for f in sampler.add(Frame(k, t, image))]
    chosen += [f.timestamp_s for f in sampler.flush()]
    # for 0.0, 0.1, (0.2: nothing near), 0.3, 0.4, 0.5, 0.6
    assert chosen == [0.0, 0.11, 0.3, 0.39, 0.52, 0.6]


def test_rates() -> None:
    assert parse_rate("25") == 25
    assert parse_rate("29.97") == Fraction(30000, 1001)
    assert parse_rate("23.976") == Fraction(24000, 1001)
    assert parse_rate("30000/1001") == Fraction(30000, 1001)
    with pytest.raises(UsageError, match="is not a frame rate"):
        parse_rate("1e999999999")  # of which a fraction would compute all digits
    assert parse_rate("12.5") == Fraction(25, 2)
    for text in ("0", "-3", "fast", "1/0", "nan"):
        with pytest.raises(UsageError):
            parse_rate(text)


def test_an_impossible_range() -> None:
    for start, end in ((-1, 5), (5, 5), (6, 5), (float("nan"), 5)):
        with pytest.raises(UsageError):
            VideoRange(start, end)


@pytest.fixture(scope="module")
def rounded_video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write 12 s of the same at 29.97 fps, in a container that rounds times to milliseconds."""
    return write_numbers(
        tmp_path_factory.mktemp("range") / "rounded.mkv", 30000 / 1001, 360, "MJPG"
    )


@pytest.mark.parametrize(("name", "nominal"), [("long_video", 25), ("rounded_video", 30)])
def test_timecodes_select_frames(name: str, nominal: int, request: pytest.FixtureRequest) -> None:
    """From 3 s and 12 frames to 4 s and 7 frames, both included."""
    path = request.getfixturevalue(name)
    first = 3 * nominal + 12
    last = 4 * nominal + 7
    with open_video(path, parse_range("00:00:03:12", "00:00:04:07", None)) as video:
        assert [shown(f) for f in video] == list(range(first, last + 1))
        assert video.expected_frames == last + 1 - first
    with open_video(path, parse_range("00:00:03:12", "00:00:04:07", "10")) as video:
        assert video.expected_frames == len(list(video))
    for frame in (first, first + 1, first + 2):
        one = f"00:00:03:{frame - 3 * nominal}"
        with open_video(path, parse_range(one, one, None)) as video:
            assert [shown(f) for f in video] == [frame]


def test_a_range_by_seconds_and_timecode(long_video: Path) -> None:
    with open_video(long_video, parse_range("1.5", "00:00:02:00", "5")) as video:
        assert [shown(f) for f in video] == [38, 43, 48]
    assert parse_range(None, None, None) == VideoRange()
    with pytest.raises(UsageError, match="must come after"):
        open_video(long_video, parse_range("00:00:03:12", "2", None))
    with pytest.raises(UsageError, match="up to 24"):
        open_video(long_video, parse_range("00:00:03:25", None, None))
    for nothing in (("", None, None), (None, "", None), (None, None, "")):
        with pytest.raises(UsageError, match="''"):
            parse_range(*nothing)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        *(("0", 0), ("12.5", 12.5), (".5", 0.5), ("90", 90), ("01:30", 90), ("1:02:03", 3723)),
        *(("00:00:01.250", 1.25), ("1:00,5", 60.5)),
    ],
)
def test_times(text: str, seconds: float) -> None:
    assert parse_time(text) == pytest.approx(seconds)


NO_TIMES = ["", ".", "1:.5", "-1", "1:60", "1:60:00", "nan", "1:02:60:00", "1;02:03;04"]


@pytest.mark.parametrize("text", [*NO_TIMES, "1:02:03;4", "9" * 9999, "9" * 9999 + ":00:00:00"])
def test_invalid_times_are_refused(text: str) -> None:
    with pytest.raises(UsageError):
        parse_time(text)


def timecode(text: str) -> Timecode:
    got = parse_time(text)
    assert isinstance(got, Timecode)
    return got


def labels(rate: int, dropped: int) -> Iterator[str]:
    """Iterate over the timecodes of 12 minutes, without the first ``dropped`` of each minute except
    every tenth.
    """
    for minute in range(12):
        for second in range(60):
            for frame in range(rate):
                if not (minute % 10 and second == 0 and frame < dropped):
                    yield f"00:{minute:02}:{second:02}{';' if dropped else ':'}{frame:02}"


@pytest.mark.parametrize(
    ("fps", "rate", "dropped"),
    [
        (Fraction(60000, 1001), 60, 4),
        (Fraction(2997, 100), 30, 2),
        (Fraction(30000, 1001), 30, 0),
    ],
)
def test_consecutive_timecodes_are_consecutive_frames(
    fps: Fraction, rate: int, dropped: int
) -> None:
    for number, text in enumerate(labels(rate, dropped)):
        if number % 31 == 0 or ":00" in text[-6:]:
            assert timecode(text).frame(fps) == number, text


@pytest.mark.parametrize(
    ("text", "fps", "says"),
    [
        ("00:01:00;01", Fraction(30000, 1001), "first one is 02"),
        ("00:11:00;03", Fraction(60000, 1001), "first one is 04"),
        ("00:00:01;00", Fraction(30), "29.97 and 59.94"),
        ("00:00:01:25", Fraction(25), "up to 24"),
        ("00:00:01:00", Fraction(1, 4), "in seconds"),
    ],
)
def test_nonexistent_timecodes_are_refused(text: str, fps: Fraction, says: str) -> None:
    with pytest.raises(UsageError, match=says) as caught:
        timecode(text).frame(fps)
    assert text in str(caught.value)
