# SPDX-License-Identifier: GPL-3.0-or-later
"""The decoder: upright images with square pixels, how long a video is shown, and skipping.

Exact frame rates from the rounded ones that containers and OpenCV give.
"""

from __future__ import annotations

import sys
from contextlib import closing
from fractions import Fraction

import av
import numpy as np
import pytest
from scope.scope_addon.capture.media import frame_readers
from scope.scope_addon.capture.media.frame_readers import (
    PyavReader,
    exact_fps,
    packet_rates,
)
from scope.scope_addon.errors import VideoError

from .made_video import write_film, write_video


def test_without_the_decoder_a_video_is_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(
        VideoError,
        match=r"grey\.mp4 is a video.*package 'av' that is not "
        r"installed",
    ):
        PyavReader(tmp_path / "grey.mp4")


def test_a_stream_that_begins_later_does_not_end_the_video(tmp_path):
    # bytes of a packet
    size = 188
    noise = np.random.default_rng(0).integers(0, 255, (60, 48, 64, 3), np.uint8)
    path = write_film(tmp_path / "recorded.ts", noise, "mpeg2video")
    data = path.read_bytes()
    packets = [data[at : at + size] for at in range(0, len(data), size)]
    # a picture, of the stream 0x100
    begins = [k for k, packet in enumerate(packets) if packet[1:3] == b"\x41\x00"]
    assert len(begins) == 60
    middle = begins[40]
    other = packets[middle][:2] + b"\xc8" + packets[middle][3:]
    path.write_bytes(b"".join([*packets[:middle], other, *packets[middle:]]))
    with av.open(str(path)) as container:
        assert len(container.streams) == 1  # the other has not been seen yet
    with closing(PyavReader(path)) as reader:
        images = [image for _, image in iter(reader.read, None)]
    assert len(images) == 60


@pytest.mark.parametrize("packets_per_s", [25, 50])
def test_packets_of_fields_are_no_frames(tmp_path, packets_per_s):
    """Camcorders write AVCHD so, with 25 frames per second; no encoder here does."""
    path = tmp_path / "a.mkv"
    images = [np.full((32, 48, 3), k, np.uint8) for k in range(2 * packets_per_s)]
    write_video(path, images, packets_per_s)
    stated_fps = Fraction(25)
    assert packet_rates(path, stated_fps, may_have_field_packets=True) == (25, 25)
    assert packet_rates(path, stated_fps, may_have_field_packets=False) == (
        packets_per_s,
        packets_per_s,
    )
    one_second = 1000  # in units of the stream
    assert frame_readers._frames_before(path, one_second, stated_fps) == 25
    assert frame_readers._frames_before(path, one_second, None) == packets_per_s


def test_fields_and_frames_may_alternate():
    packets_s = [0.0, 0.02, 0.04, 0.08, 0.1, 0.12]
    times_s = frame_readers._frame_times(packets_s, Fraction(25))
    assert times_s.tolist() == [0.0, 0.04, 0.08, 0.12]


@pytest.mark.parametrize("is_interlaced", [False, True])
def test_frames_that_are_interlaced_may_have_packets_of_fields(tmp_path, is_interlaced):
    options = {"x264-params": "interlaced=1"} if is_interlaced else {}
    path = write_film(
        tmp_path / "a.ts", np.zeros((5, 64, 64, 3), np.uint8), "libx264", options=options
    )
    with closing(PyavReader(path)) as reader:
        reader.read()
        assert reader.may_have_field_packets == is_interlaced


@pytest.mark.parametrize(
    ("fps", "expected"),
    [
        (30000 / 1001, Fraction(30000, 1001)),
        (29.97, Fraction(2997, 100)),
        (29.9701, Fraction(30000, 1001)),
        (29.8, Fraction(149, 5)),
        (float("nan"), None),
        (90000.0, None),
    ],
)
def test_exact_fps(fps, expected):
    assert exact_fps(fps) == expected
