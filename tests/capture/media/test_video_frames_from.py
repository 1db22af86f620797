# SPDX-License-Identifier: GPL-3.0-or-later
"""Decoding from the middle of a video gives the very images that decoding from its beginning
gives.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.media.frame import Frame
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange

from ...required import need_encoder
from .made_video import write_film

FPS = 2
SECONDS = 45
STARTS_S = (3.0, 33.25)


def write(path: Path, codec: str, times_s: list[float], options: dict[str, str]) -> Path:
    """Write a disc that moves over noise."""
    images = []
    for k in range(len(times_s)):
        image = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
        image[k % 40 : k % 40 + 8, k % 56 : k % 56 + 8] = 255
        images.append(image)
    return write_film(path, images, codec, rate=FPS, times_s=times_s, options=options)


EVEN = [k / FPS for k in range(SECONDS * FPS)]
UNEVEN = [(k + 0.4 * (k % 3 == 1) + 0.02 * k) / FPS for k in range(SECONDS * FPS)]
FILES = {
    "few keyframes.mp4": ("mpeg4", EVEN, {"g": "30", "bf": "2"}),
    "open groups.mkv": (
        "libx264",
        EVEN,
        {"g": "8", "x264-params": "open-gop=1:bframes=3:threads=1"},
    ),
    "one keyframe.mp4": ("libx264", EVEN, {"g": "10000"}),
    "uneven.mkv": ("libx264", UNEVEN, {"g": "30"}),
    "vp9.webm": (
        "libvpx-vp9",
        EVEN,
        {"g": "15", "cpu-used": "8", "deadline": "realtime"},
    ),
}


def same(a: Frame, b: Frame) -> bool:
    return a.timestamp_s == b.timestamp_s and np.array_equal(a.image_rgb, b.image_rgb)


@pytest.mark.parametrize("name", FILES)
def test_frames_from_the_middle_are_those_of_the_whole(tmp_path: Path, name: str) -> None:
    codec, times_s, options = FILES[name]
    need_encoder(codec)
    path = write(tmp_path / name, codec, times_s, options)
    with open_video(path) as video:
        whole = list(video)
        assert len(whole) > 0.95 * SECONDS * FPS
        for start_s in STARTS_S:
            found = list(video.frames_from(start_s))
            expected = [frame for frame in whole if frame.timestamp_s >= start_s - 1e-6]
            assert len(found) == len(expected) > 0
            assert all(same(a, b) for a, b in zip(found, expected, strict=True))
            assert len({b.index - a.index for a, b in zip(found, expected, strict=True)}) == 1


def assert_a_late_range_has_the_indices_of_the_whole(path: Path) -> None:
    with open_video(path) as video:
        whole = [(frame.index, frame.timestamp_s) for frame in video]
    with open_video(path, VideoRange(start_s=30.0)) as video:
        found = [(frame.index, frame.timestamp_s) for frame in video]
    assert found == [each for each in whole if each[1] >= 30.0]


def test_frames_have_their_indices_where_the_range_begins_late_in_a_varying_rate(
    tmp_path: Path,
) -> None:
    """Most frames come half a second after the one before, but every fourth one later."""
    times = np.concatenate([[0.0], np.cumsum(np.tile([0.5, 0.5, 0.5, 1.5], 15))]).tolist()
    path = write(tmp_path / "varying.mp4", "mpeg4", times, {"g": "10"})
    with open_video(path) as video:
        assert video.fps == FPS
        assert float(video.average_fps) == pytest.approx(4 / 3, rel=0.04)
    assert_a_late_range_has_the_indices_of_the_whole(path)


@pytest.mark.parametrize("name", ["missing.mp4", "missing.avi"])
def test_frames_have_their_indices_where_few_are_missing(tmp_path: Path, name: str) -> None:
    """The rate counts as constant: a phone has left out one frame of 90, which AVI counts too."""
    times = [k / FPS for k in range(SECONDS * FPS) if k != 25]
    path = write(tmp_path / name, "mpeg4", times, {"g": "10"})
    with open_video(path) as video:
        assert video.average_fps == video.fps == FPS
    assert_a_late_range_has_the_indices_of_the_whole(path)


def test_the_end_of_the_range_is_kept(tmp_path: Path) -> None:
    path = write(tmp_path / "clip.mp4", "mpeg4", EVEN, {"g": "15"})
    with open_video(path, VideoRange(5.0, 40.0)) as video:
        found = [frame.timestamp_s for frame in video.frames_from(30.0)]
    assert (found[0], found[-1]) == pytest.approx((30.0, 40.0))
