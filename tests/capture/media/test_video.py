# SPDX-License-Identifier: GPL-3.0-or-later
"""Videos and pictures: synthetic files with known content, damaged files, and real clips."""

from __future__ import annotations

import errno
import os
import threading
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.frame_readers import PyavReader
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.errors import VideoError

from .corner_picture import H, W, corner_image, corners, encode
from .made_video import (
    patch_track_header,
    sound_track,
    with_time_table,
    write_film,
    write_video,
)


def ramp(count: int) -> list[np.ndarray]:
    return [np.full((H, W, 3), 10 + 4 * i, np.uint8) for i in range(count)]


CLOCKWISE = (0, 65536, 0, -65536, 0, 0, 0, 0, 1 << 30)
HALF_TURN = (-65536, 0, 0, 0, -65536, 0, 0, 0, 1 << 30)
COUNTERCLOCKWISE = (0, -65536, 0, 65536, 0, 0, 0, 0, 1 << 30)
LEFT_RIGHT = (-65536, 0, 0, 0, 65536, 0, 0, 0, 1 << 30)
TRANSPOSED = (0, 65536, 0, 65536, 0, 0, 0, 0, 1 << 30)


def test_frames_are_in_order_as_rgb_with_their_times(tmp_path):
    images = [np.full((H, W, 3), 20 * i, np.uint8) for i in range(12)]
    path = write_video(tmp_path / "a.mp4", images, fps=25)
    with open_video(path) as video:
        frames = list(video)
    assert (video.width, video.height, video.fps, video.frame_count) == (W, H, Fraction(25), 12)
    assert video.frame_count > 1
    assert not video.warnings
    assert [f.index for f in frames] == list(range(12))
    np.testing.assert_allclose([f.timestamp_s for f in frames], np.arange(12) / 25, atol=1e-6)
    for i, frame in enumerate(frames):
        assert frame.image_rgb.dtype == np.uint8
        assert frame.image_rgb.shape == (H, W, 3)
        assert abs(float(frame.image_rgb.mean()) - 20 * i) < 8


@pytest.mark.parametrize("rate", [Fraction(30000, 1001), Fraction(25)])
def test_the_container_rate_is_exact(tmp_path, rate):
    path = write_video(tmp_path / "a.mp4", ramp(10))
    with_time_table(path, rate.numerator, [(10, rate.denominator)])
    video = open_video(path)
    assert video.fps == rate
    np.testing.assert_allclose(
        [f.timestamp_s for f in video], [float(i / rate) for i in range(10)], atol=1e-6
    )


def write_times(path: Path, shown_ms: np.ndarray) -> Path:
    """Write the frames of `ramp` with given times, also repeated ones."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=25, width=W, height=H, pix_fmt="yuvj420p")
        for time_ms, image in zip(shown_ms, ramp(len(shown_ms)), strict=True):
            for packet in stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")):
                packet.time_base = Fraction(1, 1000)
                packet.pts = int(time_ms)
                packet.dts = int(time_ms)
                container.mux(packet)
    return path


@pytest.mark.parametrize("again", [[160, 160], [0, 160]])
def test_a_repeated_time_does_not_move_what_follows(tmp_path, again):
    """Each repeated time moved all later frames on by a frame."""
    shown_ms = np.sort(np.append(np.arange(0, 400, 40), again))
    with open_video(write_times(tmp_path / "a.mkv", shown_ms)) as video:
        times_ms = np.array([f.timestamp_s for f in video]) * 1000
    is_repeated = np.diff(shown_ms, prepend=-1) == 0
    np.testing.assert_allclose(times_ms[~is_repeated], shown_ms[~is_repeated], atol=1e-6)
    assert (np.diff(times_ms) > 0).all()


def test_a_range_of_a_stream_without_times_has_the_times_of_the_whole(tmp_path):
    path = write_film(tmp_path / "bare.h264", ramp(30), "libx264")
    with open_video(path, VideoRange(start_s=0.49, end_s=0.61)) as video:
        part = list(video)
    assert [f.index for f in part] == [13, 14, 15]
    np.testing.assert_allclose([f.timestamp_s for f in part], [0.52, 0.56, 0.6], atol=1e-6)
    assert [f.image_rgb.mean() for f in part] == pytest.approx([62, 66, 70], abs=3)


def test_a_variable_rate_keeps_presentation_times(tmp_path):
    path = write_video(tmp_path / "a.mp4", ramp(9))
    with_time_table(path, 1000, [(3, 40), (3, 100), (3, 20)])
    with open_video(path) as video:
        times = [f.timestamp_s for f in video]
    np.testing.assert_allclose(
        times, np.cumsum([0, 40, 40, 40, 100, 100, 100, 20, 20]) / 1000, atol=1e-6
    )
    (warning,) = video.warnings
    assert (warning.code, warning.values["rate"]) == ("variable_frame_rate", float(video.fps))


@pytest.mark.parametrize(
    ("fps", "steps", "gaps"),
    [
        (25, [(2, 40), (1, 1500), (6, 40)], ([0.08], 1.5)),
        (25, [(2, 40), (1, 480), (6, 40)], None),  # shorter than half a second
        (5, [(2, 200), (1, 1800), (6, 200)], None),  # less than ten frames
    ],
)
def test_frames_that_are_lacking_inside_are_said(tmp_path, fps, steps, gaps):
    """A damaged part of a file was left out without a word."""
    path = write_video(tmp_path / "a.mp4", ramp(9), fps)
    with_time_table(path, 1000, steps)
    with open_video(path) as video:
        found = video.gap_notices([f.timestamp_s for f in video])
    assert [(n.values["times"], n.values["longest_s"]) for n in found] == ([gaps] if gaps else [])


def test_a_variable_rate_is_noticed_where_the_container_does_not_count_frames(tmp_path):
    """Indices from 20 s on followed from the rate that the container states."""
    shown_s = [*range(20), *np.arange(20, 40, 0.5)]
    path = write_times(tmp_path / "a.mkv", np.multiply(shown_s, 1000))
    with open_video(path, VideoRange(start_s=30)) as video:
        first = next(iter(video))
    assert [warning.code for warning in video.warnings] == ["variable_frame_rate"]
    assert (video.fps, first.index, first.timestamp_s) == (2, 40, 30.0)


def test_as_many_frames_are_expected_as_a_slightly_varying_rate_gives(tmp_path):
    """Mostly 30 per second, and some at half the distance."""
    path = write_video(tmp_path / "a.mp4", ramp(10) * 10)
    with_time_table(path, 600, [(48, 20), (4, 10), (48, 20)])
    with open_video(path) as video:
        assert video.fps == 30
        assert video.expected_frames == len(list(video)) == 100
    with open_video(path, VideoRange(fps=Fraction(15))) as video:
        assert abs(video.expected_frames - len(list(video))) <= 1


@pytest.mark.parametrize(
    ("matrix", "expected", "size"),
    [
        (CLOCKWISE, "brwg", (H, W)),
        (HALF_TURN, "wbgr", (W, H)),
        (COUNTERCLOCKWISE, "gwrb", (H, W)),
        (LEFT_RIGHT, "grwb", (W, H)),
        (TRANSPOSED, "rbgw", (H, W)),
    ],
)
def test_rotation_and_mirroring_of_the_metadata_are_applied(tmp_path, matrix, expected, size):
    path = write_video(tmp_path / "a.mp4", [corner_image()] * 2)
    patch_track_header(path, matrix=matrix)
    video = open_video(path)
    assert (video.width, video.height) == size
    for frame in video:
        assert frame.image_rgb.shape == (size[1], size[0], 3)
        assert corners(frame.image_rgb) == expected


@pytest.mark.parametrize(
    ("display_width", "matrix", "size"),
    [(W // 2, None, (W, 2 * H)), (2 * W, CLOCKWISE, (H, 2 * W))],
)
def test_pixels_become_square(tmp_path, display_width, matrix, size):
    path = write_video(tmp_path / "a.mp4", [corner_image()] * 2)
    patch_track_header(path, matrix, display_width)
    video = open_video(path)
    assert (video.width, video.height) == size
    assert next(iter(video)).image_rgb.shape == (size[1], size[0], 3)


def test_opencvs_ffmpeg_decodes_the_same(tmp_path):
    path = write_video(tmp_path / "a.mp4", [corner_image(), 255 - corner_image()] * 10, fps=25)
    reader = PyavReader(path)
    other = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    assert reader.rate == other.get(cv2.CAP_PROP_FPS) == 25
    assert reader.frame_count == other.get(cv2.CAP_PROP_FRAME_COUNT) == 20
    frames = [other.read()[1] for _ in range(20)]
    assert reader.skip_to(0.2, Fraction(25))[0] == 5
    for k in range(5, 20):
        time, image = reader.read()
        assert time == pytest.approx(0.04 * k)
        np.testing.assert_allclose(image.astype(int), frames[k][..., ::-1].astype(int), atol=2)
    assert reader.read() is None
    reader.close()


def test_ending_an_iteration_early_ends_the_decoding_thread(tmp_path):
    path = write_video(tmp_path / "a.mp4", ramp(50))
    before = threading.enumerate()

    def decoding() -> bool:
        return any(t.name == "scope-decode" for t in threading.enumerate() if t not in before)

    with open_video(path) as video:
        for frame in video:
            if frame.index == 2:
                break
        assert not decoding()
        unfinished = iter(video)
        next(unfinished)
    assert not decoding()
    with pytest.raises(StopIteration):
        next(unfinished)


# Pictures


@pytest.mark.parametrize("suffix", [".jpg", ".webp", ".tiff", ".bmp"])
def test_a_picture_is_one_frame(tmp_path, suffix):
    path = tmp_path / f"picture{suffix}"
    path.write_bytes(encode(suffix, corner_image(65, 49)))
    with open_video(path) as video:
        frames = list(video)
    assert video.frame_count == 1
    assert (video.width, video.height, video.frame_count, video.focal_35mm) == (65, 49, 1, None)
    assert [(f.index, f.timestamp_s) for f in frames] == [(0, 0.0)]
    assert corners(frames[0].image_rgb) == "rgbw"


def test_sixteen_bits_grey_and_alpha(tmp_path):
    deep = corner_image().astype(np.uint16)[..., ::-1] * 257
    for suffix in (".png", ".tiff"):
        cv2.imwrite(str(tmp_path / f"deep{suffix}"), deep)
        np.testing.assert_array_equal(
            next(iter(open_video(tmp_path / f"deep{suffix}"))).image_rgb, corner_image()
        )
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((H, W), 77, np.uint8))
    assert (next(iter(open_video(tmp_path / "grey.png"))).image_rgb == 77).all()
    clear = np.dstack([corner_image(), np.full((H, W), 255, np.uint8)])
    clear[: H // 2, : W // 2, 3] = 0
    (tmp_path / "clear.png").write_bytes(encode(".png", clear))
    assert corners(next(iter(open_video(tmp_path / "clear.png"))).image_rgb) == "wgbw"


# Files that cannot be used


@pytest.mark.parametrize(
    ("name", "make", "words"),
    [
        ("missing.mp4", lambda p: None, "does not exist"),
        ("empty.mp4", lambda p: p.write_bytes(b""), "is empty"),
        ("folder.mp4", lambda p: p.mkdir(), "is a folder"),
        ("text.mp4", lambda p: p.write_text("not a film at all\n" * 50), "not a video or image"),
        ("sound.mp4", sound_track, "contains only audio; choose the file with the video"),
        ("cover.mp4", lambda p: sound_track(p, corner_image()), "contains only audio"),
        (
            "half.png",
            lambda p: p.write_bytes(encode(".png", corner_image())[:40]),
            "cannot be decoded",
        ),
        (
            "cut.mp4",
            lambda p: p.write_bytes(write_video(p, ramp(9)).read_bytes()[:700]),
            "not a video or image",
        ),
    ],
)
def test_unusable_files_give_a_message_of_one_line(tmp_path, capfd, name, make, words):
    make(tmp_path / name)
    with pytest.raises(VideoError, match=words) as caught:
        open_video(tmp_path / name)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no named pipes in folders")
def test_a_pipe_is_refused_without_waiting(tmp_path):
    path = tmp_path / "pipe.mp4"
    os.mkfifo(path)
    both_ends = os.open(path, os.O_RDWR)  # so that opening it never blocks
    try:
        with pytest.raises(VideoError, match="pipe.mp4 is a pipe or a device"):
            open_video(path)
    finally:
        os.close(both_ends)


def test_a_truncated_video_gives_its_frames_and_a_warning(tmp_path, capfd):
    rng = np.random.default_rng(1)
    images = [rng.integers(0, 255, (H, W, 3), dtype=np.uint8) for _ in range(40)]
    path = write_video(tmp_path / "a.mkv", images)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    video = open_video(path)
    frames = list(video)
    assert 5 < len(frames) < 35
    assert len(video.warnings) == 1
    assert "stopped after" in str(video.warnings[0])
    assert capfd.readouterr().err == ""


def test_seconds_that_are_lost_at_the_end_of_a_long_video_are_said(tmp_path):
    """They are less than a twentieth of the video."""
    path = write_video(tmp_path / "a.mp4", ramp(1) * 80, fps=2)
    with av.open(str(path)) as container:
        lost_at = [packet.pos for packet in container.demux(video=0) if packet.size][-3]
    data = bytearray(path.read_bytes())
    end = data.find(b"moov") - 4
    data[lost_at:end] = bytes(end - lost_at)
    path.write_bytes(data)
    with open_video(path) as video:
        assert len(list(video)) == 77
    assert [warning.code for warning in video.warnings] == ["decoding_stopped"]


def test_footage_whose_disk_fails_meanwhile_is_no_shorter_video(tmp_path, monkeypatch):
    """A capture of a part would be done, and skipped by the next batch. FFmpeg says the same of
    damaged data.
    """
    path = write_video(tmp_path / "a.mkv", ramp(40))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    video = open_video(path)

    def fail(*_, **__):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(Path, "open", fail)
    with pytest.raises(VideoError, match=r"a.mkv cannot be read any more \(Input/output error\)"):
        list(video)


@pytest.mark.parametrize("end_s", [np.inf, 0.2])
def test_a_video_that_is_still_being_written_gives_a_warning(tmp_path, end_s):
    data = write_video(tmp_path / "whole.ts", ramp(40)).read_bytes()
    path = tmp_path / "a.ts"
    path.write_bytes(data[: len(data) // 2 // 188 * 188])
    video = open_video(path, VideoRange(end_s=end_s))
    with path.open("ab") as file:
        file.write(data[path.stat().st_size :])
    assert len(list(video)) > 1
    grown = [text for text in map(str, video.warnings) if "a.ts grew while it was read" in text]
    assert len(grown) == (1 if end_s == np.inf else 0), video.warnings


def test_a_video_that_is_removed_while_it_is_read_gives_its_frames(tmp_path):
    path = write_video(tmp_path / "a.mp4", ramp(20))
    video = open_video(path)
    frames = iter(video)
    next(frames)
    path.unlink()
    assert len(list(frames)) == 19
    assert video.warnings == []
