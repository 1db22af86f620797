# SPDX-License-Identifier: GPL-3.0-or-later
"""The windows of a clip cover all of its frames once, and begin to warm up within the window
before.
"""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from scope.scope_addon.capture.long_clips.windows import plan_windows
from scope.scope_addon.capture.media.video import StatedRate, Video, open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import WINDOW_S

ALL = VideoRange()


def video(seconds: float, wanted: VideoRange = ALL) -> Video:
    return Video(Path("clip.mp4"), 640, 480, Fraction(30), round(30 * seconds), wanted=wanted)


@pytest.mark.parametrize("seconds", [1, 239])
def test_a_clip_shorter_than_two_windows_has_one(seconds: int) -> None:
    (only,) = plan_windows(video(seconds), WINDOW_S)
    assert (only.anchor_s, only.begin_s, only.end_s) == (0.0, 0.0, math.inf)


def test_every_frame_of_an_hour_is_in_one_window() -> None:
    windows = plan_windows(video(3600), WINDOW_S)
    assert len(windows) == 30
    for k in range(0, 30 * 3600, 7):
        assert sum(w.has_begun(k / 30) and not w.has_ended(k / 30) for w in windows) == 1
    assert all(0.0 < w.begin_s - w.anchor_s <= 2.0 for w in windows[1:])
    assert not windows[-1].has_ended(1e9)  # the container may say too little


def test_windows_begin_where_the_range_does() -> None:
    windows = plan_windows(video(3600, VideoRange(1000, 1250)), WINDOW_S)
    assert [w.begin_s for w in windows] == [1000, 1120]
    assert windows[0].anchor_s == 1000


def test_windows_are_as_long_where_the_frame_rate_varies() -> None:
    """Most frames come at 30 frames/s, but some so late that there are only 24 in a second."""
    rate = StatedRate(Fraction(30), average_fps=Fraction(24))
    varying = Video(Path("clip.mp4"), 640, 480, Fraction(30), 24 * 250, rate=rate)
    assert [w.begin_s for w in plan_windows(varying, WINDOW_S)] == [0, 120]


def test_short_windows_do_not_warm_up_before_the_one_before() -> None:
    windows = plan_windows(video(10), 1.0)
    assert all(b.anchor_s > a.begin_s for a, b in zip(windows, windows[1:], strict=False))


@pytest.mark.parametrize(
    ("suffix", "frames", "days", "most"), [("mkv", 12, 127, 3), ("mp4", 60, 0.01, 15)]
)
def test_windows_are_planned_by_frames_not_by_the_time_that_they_span(
    tmp_path: Path, suffix: str, frames: int, days: float, most: int
) -> None:
    """Each has a file and trackers of its own."""
    path = tmp_path / f"rare.{suffix}"
    with av.open(path, "w") as container:
        stream: Any = container.add_stream("mjpeg", rate=30)
        stream.width = stream.height = 64
        stream.pix_fmt = "yuvj420p"
        for number in range(frames):
            image = np.full((64, 64, 3), number, np.uint8)
            for packet in stream.encode(av.VideoFrame.from_ndarray(image)):
                packet.time_base = Fraction(1, 1000)
                packet.pts = packet.dts = round(number * days * 86_400_000 / (frames - 1))
                container.mux(packet)
    with open_video(path) as video:
        assert 1 <= len(plan_windows(video, WINDOW_S)) <= most
