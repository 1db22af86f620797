# SPDX-License-Identifier: GPL-3.0-or-later
"""Videos that are written can be read, and one that cannot be written is an error of one
sentence.
"""

from __future__ import annotations

import os
import sys
from fractions import Fraction

import av
import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.video_writer import VideoWriter
from scope.scope_addon.errors import OutputError

GREY = np.full((48, 64, 3), 90, np.uint8)


def write(writer, count):
    for k in range(count):
        writer.write(GREY + np.uint8(30 * k % 120))
    writer.close()


@pytest.mark.parametrize(
    ("suffix", "fps"),
    [(".mp4", Fraction(1000007, 33367)), (".mov", Fraction(5)), (".mkv", Fraction(30000, 1001))],
)
def test_another_ffmpeg_reads_what_is_written(tmp_path, suffix, fps):
    path = tmp_path / f"a{suffix}"
    write(VideoWriter(path, fps, 64, 48, path), 4)
    video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(float(fps), rel=1e-3)
    assert int(video.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little") in (b"avc1", b"h264", b"H264")
    levels = [int(video.read()[1].mean()) for _ in range(4)]
    assert not video.read()[0]
    assert levels == pytest.approx([90, 120, 150, 180], abs=3)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="only Linux has this device")
def test_a_full_disk_is_an_error(tmp_path):
    (tmp_path / "a.mkv").symlink_to("/dev/full")
    with pytest.raises(
        OutputError,
        match=r"could not finish writing .*shown\.mkv; free some "
        r"space",
    ):
        write(VideoWriter(tmp_path / "a.mkv", Fraction(30), 64, 48, tmp_path / "shown.mkv"), 2)


def test_without_pyav_a_picture_is_advised(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(OutputError, match=r"'av', which is not installed; choose a \.png"):
        VideoWriter(tmp_path / "a.mp4", Fraction(30), 64, 48, tmp_path / "a.mp4")
    assert list(tmp_path.iterdir()) == []


def test_another_codec_is_used_where_there_is_no_x264(tmp_path, monkeypatch):
    monkeypatch.setattr(av, "codecs_available", {"mpeg4"})
    path = tmp_path / "a.mp4"
    write(VideoWriter(path, Fraction(30), 64, 48, path), 2)
    assert (
        int(cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little") == b"FMP4"
    )
    monkeypatch.setattr(av, "codecs_available", set())
    with pytest.raises(OutputError, match="no video encoder was found"):
        VideoWriter(path, Fraction(30), 64, 48, path)
