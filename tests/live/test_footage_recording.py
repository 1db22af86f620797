# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of a live capture as a video that other readers understand."""

import subprocess
import sys
import threading
import time
from fractions import Fraction

import av
import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_writer import VideoWriter
from scope.scope_addon.errors import OutputError
from scope.scope_addon.live.footage_recording import FootageRecording
from scope.scope_addon.live.source import Picture

TIMES = [7.0, 7.033, 7.2, 7.233, 7.3]  # frames were dropped on the way


def picture(k, shape=(49, 64, 3)):
    return Picture(20 + k, TIMES[k], 0.0, np.full(shape, 40 * k, np.uint8))


def test_pictures_keep_their_times_and_order(tmp_path):
    path = tmp_path / "take.mp4"
    footage = FootageRecording(path, Fraction(30))
    for k in range(len(TIMES)):
        footage.add(picture(k))
    assert footage.save() == path
    assert (footage.origin, footage.missing) == ((20, 7.0), "")
    with av.open(str(path)) as video:
        frames = list(video.decode(video=0))
    assert [frame.time for frame in frames] == pytest.approx([t - 7.0 for t in TIMES], abs=1e-3)
    brightness = [frame.to_ndarray(format="gray").mean() for frame in frames]
    assert brightness == sorted(brightness)
    assert (frames[0].width, frames[0].height) == (64, 48)
    assert b"moof" not in path.read_bytes()  # an ordinary file, without parts
    assert [entry.name for entry in tmp_path.iterdir()] == ["take.mp4"]


KILLED = """
import os, signal, sys, time
from fractions import Fraction
from pathlib import Path
import numpy as np
from scope.scope_addon.live.footage_recording import FootageRecording
from scope.scope_addon.live.source import Picture
footage = FootageRecording(Path(sys.argv[1]), Fraction(30))
for k in range(150):
    footage.add(Picture(k, k / 30, 0.0, np.full((48, 64, 3), k, np.uint8)))
    while footage._waiting.qsize():
        time.sleep(0.001)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_capture_leaves_can_be_read_and_is_not_replaced(tmp_path):
    path = tmp_path / "take.mp4"
    path.write_bytes(b"an earlier take")
    for _ in range(2):
        subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    left = sorted(entry.name for entry in tmp_path.iterdir())
    assert left == ["take.mp4", "take.unfinished 2.mp4", "take.unfinished.mp4"]
    assert path.read_bytes() == b"an earlier take"
    with open_video(tmp_path / "take.unfinished.mp4") as video:
        frames = list(video)
    assert len(frames) > 60  # of 5 s, some are in the encoder, and some in the last part
    brightness = [frame.image_rgb.mean() for frame in frames]
    np.testing.assert_allclose(brightness, np.arange(len(frames)), atol=4)


def test_without_pictures_nothing_is_written(tmp_path):
    assert FootageRecording(tmp_path / "take.mp4", Fraction(30)).save() is None
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_written_is_said(tmp_path):
    footage = FootageRecording(tmp_path / "none" / "take.mp4", Fraction(30))
    for k in range(len(TIMES)):
        footage.add(picture(k))
    with pytest.raises(OutputError, match="its folder does not exist"):
        footage.save()


def test_a_full_disk_keeps_the_pictures_until_then_and_the_earlier_take(tmp_path, monkeypatch):
    path = tmp_path / "take.mp4"
    path.write_bytes(b"an earlier take")
    write = VideoWriter.write

    def full(writer, image, time_s=None):
        if time_s > 2.0:
            raise OutputError(f"could not finish writing {path}")
        write(writer, image, time_s)

    monkeypatch.setattr(VideoWriter, "write", full)
    footage = FootageRecording(path, Fraction(30))
    for k in range(90):
        footage.add(Picture(k, k / 30, 0.0, np.full((48, 64, 3), k, np.uint8)))
        while footage._waiting.qsize() and footage._thread.is_alive():
            time.sleep(0.001)
    kept = tmp_path / "take.unfinished.mp4"
    with pytest.raises(OutputError, match=f"could not.*; the images until then are in {kept}"):
        footage.save()
    assert path.read_bytes() == b"an earlier take"
    with open_video(kept) as video:
        assert sum(1 for _ in video) >= 40  # some were in the encoder


def test_of_two_captures_at_once_neither_replaces_the_others_footage(tmp_path):
    path = tmp_path / "take.mp4"
    path.write_bytes(b"an earlier take")
    first = FootageRecording(path, Fraction(30))
    second = FootageRecording(path, Fraction(30))
    for k in range(len(TIMES)):
        first.add(picture(k))
        second.add(picture(k, (98, 128, 3)))
    assert first.save() == path
    kept = tmp_path / "take.unfinished 2.mp4"
    with pytest.raises(OutputError, match=f"has written it meanwhile; the images .* in {kept}"):
        second.save()
    for file, width in ((path, 64), (kept, 128)):
        with open_video(file) as video:
            assert [frame.image_rgb.shape[1] for frame in video] == [width] * len(TIMES)


def test_pictures_of_another_size_are_left_out_and_counted(tmp_path):
    footage = FootageRecording(tmp_path / "take.mp4", Fraction(30))
    footage.add(picture(0))
    footage.add(picture(1, (60, 80, 3)))
    path = footage.save()
    assert footage.missing.startswith(f"{path} lacks 1 frame of another size than the first one")


def test_pictures_that_come_too_fast_are_told_from_those_of_another_size(tmp_path, monkeypatch):
    write = VideoWriter.write
    is_over = threading.Event()

    def slow(*arguments):
        is_over.wait(30.0)
        write(*arguments)

    monkeypatch.setattr(VideoWriter, "write", slow)
    footage = FootageRecording(tmp_path / "take.mp4", Fraction(30))
    for k in range(40):
        footage.add(Picture(k, k / 30, 0.0, np.full((48, 64, 3), k, np.uint8)))
    footage.add(picture(1, (64, 48, 3)))
    is_over.set()
    path = footage.save()
    with open_video(path) as video:
        written = len(list(video))
    assert 0 < written < 40
    busy = f"{path} lacks {40 - written} frames for which the computer was too busy and 1 frame of"
    assert footage.missing.startswith(busy)
