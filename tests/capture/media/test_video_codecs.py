# SPDX-License-Identifier: GPL-3.0-or-later
"""Codecs and containers of phones, cameras and editors: no frame is missing, twice, or in another's
place.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.errors import VideoError

from ...required import need_encoder
from .made_video import write_film

COUNT = 12
RATE = 25
FILES = {
    "phone.mp4": ("libx264", "yuv420p", {}),
    "newer phone.mp4": ("libx265", "yuv420p", {"x265-params": "log-level=none"}),
    "web.webm": ("libvpx-vp9", "yuv420p", {"deadline": "realtime"}),
    "newer web.mp4": ("libsvtav1", "yuv420p", {}),
    "editor.mov": ("prores_ks", "yuv422p10le", {}),
    "old camera.avi": ("mpeg4", "yuv420p", {}),
    "archive.mkv": ("ffv1", "yuv420p", {}),
}


def write(path: Path) -> Path:
    """Write frames of one colour each, of which red rises and blue falls from frame to frame."""
    codec, pixels, options = FILES[path.name]
    need_encoder(codec)
    colours = [(255 * k / COUNT, 128, 255 - 255 * k / COUNT) for k in range(COUNT)]
    images = [np.full((64, 96, 3), colour).astype(np.uint8) for colour in colours]
    return write_film(path, images, codec, pixels, RATE, options=options)


@pytest.mark.parametrize("name", FILES)
def test_every_frame_has_its_colour_and_time(tmp_path: Path, name: str) -> None:
    with open_video(write(tmp_path / name)) as video:
        assert (video.width, video.height) == (96, 64)
        frames = list(video)
    times_s = np.array([frame.timestamp_s for frame in frames])
    np.testing.assert_allclose(times_s - times_s[0], np.arange(COUNT) / RATE, atol=2e-3)
    seen = np.array([frame.image_rgb[32, 48] for frame in frames], int)
    assert (np.diff(seen[:, 0]) > 3).all(), seen
    assert (np.diff(seen[:, 2]) < -3).all(), seen
    assert np.ptp(seen[:, 1]) < 35


def test_a_part_and_a_damaged_half_of_av1(tmp_path: Path) -> None:
    path = write(tmp_path / "newer web.mp4")
    with open_video(path, VideoRange(start_s=0.19, end_s=0.33)) as video:
        assert [frame.index for frame in video] == [5, 6, 7, 8]
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(VideoError, match="convert"), open_video(path) as video:
        list(video)


def test_gif_with_its_own_delays(tmp_path: Path) -> None:
    path = tmp_path / "a.gif"
    shown_s = [0.0, 0.1, 0.2, 0.6, 0.7]
    images = [np.full((48, 64, 3), 40 * k, np.uint8) for k in range(5)]
    write_film(path, images, "gif", "gray", times_s=shown_s)
    with open_video(path) as video:
        frames = list(video)
    assert [frame.image_rgb[24, 32, 0] for frame in frames] == pytest.approx(
        [0, 40, 80, 120, 160], abs=2
    )
    times_s = np.array([frame.timestamp_s for frame in frames])
    np.testing.assert_allclose(times_s - times_s[0], shown_s, atol=0.011)
