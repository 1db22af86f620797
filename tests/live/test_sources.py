# SPDX-License-Identifier: GPL-3.0-or-later
"""Files in real time, streams from a server made here, and what cannot be opened."""

import sys
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from itertools import islice
from threading import Thread

import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.errors import OfflineError, VideoError
from scope.scope_addon.live.clock import Clock
from scope.scope_addon.live.newest_frame import NewestFrame
from scope.scope_addon.live.sources import is_stream, open_source

from ..capture.media.made_video import patch_track_header, write_video
from .fake_source import FakeClock
from .mjpeg_server import mjpeg_server


def test_a_file_is_paced_by_its_timestamps():
    clock = FakeClock()
    arrived = [(p.timestamp_s, p.arrived_s) for p in islice(open_source(str(SAMPLE)).pictures(clock), 6)]
    assert [time_s for time_s, _ in arrived] == pytest.approx(np.arange(6) / 30, abs=1e-3)
    assert [arrived_s - 100.0 for _, arrived_s in arrived] == pytest.approx(np.arange(6) / 30, abs=1e-3)


@pytest.fixture(scope="module")
def pictures():
    with open_video(SAMPLE) as video:
        return [frame.image_rgb[::4, ::4] for frame in islice(video, 0, 12, 3)]


def test_a_stream_is_read_and_after_its_end_read_again(pictures):
    said, taken, clock = [], [], Clock()
    with mjpeg_server(pictures, rounds=3) as address:
        source = open_source(address)
        with NewestFrame(source, clock, reconnect_s=0.05, say=said.append) as reader:
            while len(taken) < 15 and (picture := reader.take()) is not None:  # of twelve, before it is interrupted
                taken.append(picture)
    assert len(taken) == 15
    assert taken[0].image_rgb.shape == pictures[0].shape
    assert np.abs(taken[0].image_rgb.astype(int) - pictures[0]).mean() < 12  # JPEG, and its colours
    assert all(b.timestamp_s > a.timestamp_s for a, b in zip(taken, taken[1:], strict=False))
    assert said
    assert said[0].endswith("connecting again in 0.05 s")


def test_a_stream_s_rotation_and_pixel_aspect_are_applied(tmp_path, monkeypatch):
    image = np.full((96, 160, 3), 30, np.uint8)
    image[:48] = 220  # the upper half is bright; rotated clockwise, the right one is
    path = write_video(tmp_path / "a.mp4", [image] * 4, codec="mjpg")  # each frame by itself
    patch_track_header(path, (0, 65536, 0, -65536, 0, 0, 0, 0, 1 << 30), width=320)
    monkeypatch.setattr(SimpleHTTPRequestHandler, "log_message", lambda *_: None)
    handler = partial(SimpleHTTPRequestHandler, directory=str(tmp_path))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        source = open_source(f"http://127.0.0.1:{server.server_port}/a.mp4")
        rotated = next(source.pictures(Clock())).image_rgb.astype(int)
        server.shutdown()
    assert rotated.shape == (320, 96, 3)
    assert rotated[:, 60:].mean() - rotated[:, :36].mean() > 150


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("missing.mp4", "missing.mp4 does not exist; check the path"),
        ("gopher://host/x", "'gopher' is not a kind of stream that can be read; use http, https, rtsp"),
        ("file:///etc/passwd", "'file' is not a kind of stream"),
    ],
)
def test_what_is_no_source_is_said(text, message):
    with pytest.raises(VideoError, match=message):
        open_source(text)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="devices of Linux")
def test_a_camera_that_does_not_exist_is_said():
    with pytest.raises(VideoError, match="camera 987 does not exist; (choose one of /dev|connect a camera)"):
        open_source("987")


def test_a_server_that_does_not_run_is_said_without_the_password():
    with pytest.raises(VideoError, match=r"^http://127.0.0.1:9/v cannot be opened \(connection refused\); check"):
        next(iter(open_source("http://me:secret@127.0.0.1:9/v").pictures(Clock())))


@pytest.mark.parametrize("address", ["rtsp://camera/x", "http://127.0.0.1:1/v", "UDP://@:5000"])
def test_a_stream_is_refused_without_online_access(address):
    assert is_stream(address)
    with pytest.raises(OfflineError, match="Allow Online Access"):
        open_source(address, online=False)


@pytest.mark.parametrize("text", ["0", "/dev/video0", str(SAMPLE)])
def test_cameras_and_files_are_no_streams(text):
    assert not is_stream(text)
