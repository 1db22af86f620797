# SPDX-License-Identifier: GPL-3.0-or-later
"""Files in real time, streams from a server made here, and what cannot be opened."""

import sys
import threading
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.errors import OfflineError, VideoError
from scope.scope_addon.live import newest_frame, stream
from scope.scope_addon.live import source as live_source
from scope.scope_addon.live.newest_frame import NewestFrame
from scope.scope_addon.live.open_source import is_stream, open_source
from scope.scope_addon.live.source import LEAP_S, Clock
from scope.scope_addon.live.stream import SentTimes

from .fake_source import FakeClock
from .mjpeg_server import mjpeg_server
from .stream_server import (
    encoded,
    pushed,
    served,
    served_as_hls,
)


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """However long a busy computer does not run a server's thread, its stream does not count as
    interrupted.
    """
    for module in (newest_frame, stream):
        monkeypatch.setattr(module, "STALLED_S", 300.0)


def test_a_file_is_paced_by_its_timestamps():
    clock = FakeClock()
    arrived = [
        (p.timestamp_s, p.arrived_s) for p in islice(open_source(str(SAMPLE)).pictures(clock), 6)
    ]
    assert [time_s for time_s, _ in arrived] == pytest.approx(np.arange(6) / 30, abs=1e-3)
    assert [arrived_s - 100.0 for _, arrived_s in arrived] == pytest.approx(
        np.arange(6) / 30, abs=1e-3
    )


def test_a_file_goes_on_where_it_was_when_the_computer_slept():
    """Nothing that would have been shown meanwhile is made up for, which would be shown as fast as
    it can be read.
    """
    clock = FakeClock()
    arrived = []
    for picture in islice(open_source(str(SAMPLE)).pictures(clock), 8):
        arrived.append(picture.arrived_s - 100.0)
        if picture.index == 3:
            clock.time_s += 3600.0
    expected = np.arange(8) / 30
    expected[4:] += 3600.0 - 1 / 30  # the next picture was due a thirtieth of a second later
    assert arrived == pytest.approx(expected, abs=1e-3)


def test_a_file_that_cannot_be_read_in_time_is_as_late_as_it_is_and_said_once():
    """Each frame takes 0.2 s, but plays for a thirtieth of one."""
    clock = FakeClock()
    source = open_source(str(SAMPLE))
    late_s = []
    for picture in islice(source.pictures(clock), 20):
        late_s.append(clock.time_s - picture.arrived_s)
        clock.time_s += 0.2
    assert late_s[6] == pytest.approx(6 * (0.2 - 1 / 30), abs=1e-3)
    assert max(late_s) <= LEAP_S
    assert [str(warning) for warning in source.warnings] == [
        "this computer cannot read sample.mp4 as fast as it plays, so it runs in slow motion; "
        "convert it to 720p"
    ]


def test_slow_motion_is_played_at_the_speed_of_what_happened(monkeypatch):
    def tagged(path):
        video = open_video(path)
        assert video.rate is not None
        video.rate = replace(video.rate, recorded_speed=8.0)
        return video

    monkeypatch.setattr(live_source, "open_video", tagged)
    clock = FakeClock()
    source = open_source(str(SAMPLE))
    times = [(p.timestamp_s, p.arrived_s - 100.0) for p in islice(source.pictures(clock), 6)]
    assert np.array(times) == pytest.approx(np.arange(6)[:, None] / 240 * [1, 1], abs=1e-3)
    assert (source.fps, source.speed) == (240, 8.0)
    assert str(source.warnings[0]).startswith("sample.mp4 was recorded 8 times as fast as it plays")


def test_what_is_wrong_with_a_file_is_said(tmp_path):
    said = []
    data = encoded(moving(60), "libx264", kind="matroska")
    (tmp_path / "cut.mkv").write_bytes(data[: len(data) // 2])
    with NewestFrame(
        open_source(str(tmp_path / "cut.mkv")), FakeClock(), say=said.append
    ) as reader:
        reader._thread.join(300)
    assert len(said) == 1
    assert said[0].startswith("decoding cut.mkv stopped after ")


@pytest.fixture(scope="module")
def pictures():
    with open_video(SAMPLE) as video:
        return [frame.image_rgb[::4, ::4] for frame in islice(video, 0, 12, 3)]


def test_a_stream_is_read_and_after_its_end_read_again(pictures):
    said = []
    taken = []
    clock = Clock()
    with mjpeg_server(pictures, rounds=3) as address:
        source = open_source(address)
        with NewestFrame(source, clock, reconnect_s=0.05, say=said.append) as reader:
            # of twelve, before it is interrupted
            while len(taken) < 15 and (picture := reader.take()) is not None:
                taken.append(picture)
    assert len(taken) == 15
    assert taken[0].image_rgb.shape == pictures[0].shape
    # on a busy machine, others have come before it is taken
    first = pictures[taken[0].index % len(pictures)]
    assert np.abs(taken[0].image_rgb.astype(int) - first).mean() < 12  # JPEG, and its colours
    assert all(b.timestamp_s > a.timestamp_s for a, b in zip(taken, taken[1:], strict=False))
    assert said
    assert said[0].endswith("connecting again in 0.05 s")


def test_the_end_of_a_capture_closes_the_connection(pictures):
    """Before the reader itself is left: a recording is written only then."""
    left = threading.Event()
    clock = Clock()
    with mjpeg_server(pictures, rounds=10_000, left=left) as address:
        with NewestFrame(open_source(address), clock, reconnect_s=0.05) as reader:
            assert reader.take() is not None
            clock.stopped.set()
            assert left.wait(300)


def moving(count, size=(160, 96), first=0):
    """Pictures of a slope over which a bright bar moves; the k-th is told from the others by
    `which`.
    """
    width, height = size
    pictures = np.zeros((count, height, width, 3), np.uint8)
    pictures += np.linspace(20, 120, height).astype(np.uint8)[:, None, None]
    for k in range(count):
        pictures[k, :, (first + k) * width // 40 : ((first + k) * width // 40) + width // 8] = 240
    return list(pictures)


def which(image):
    """The number of a picture of `moving`, and by how much it deviates from it."""
    height, width = image.shape[:2]
    off = [np.abs(image.astype(int) - picture).mean() for picture in moving(36, (width, height))]
    return int(np.argmin(off)), min(off)


def all_pictures(address):
    """The pictures of a stream during which no time passes, so that nothing is shown because it has
    been waited for.
    """
    return [
        picture for picture in open_source(address).pictures(FakeClock()) if picture is not None
    ]


def test_damaged_packets_cost_their_own_frames_only(tmp_path):
    data = bytearray(encoded(moving(30), "mjpeg", "nut"))
    pieces = [at for at in range(len(data)) if data[at : at + 3] == b"\xff\xd8\xff"]
    assert len(pieces) == 30
    data[pieces[11] : pieces[12] - 40] = bytes(pieces[12] - 40 - pieces[11])
    with served(tmp_path, "a.nut", bytes(data)) as address:
        shown = [which(picture.image_rgb) for picture in all_pictures(address)]
    assert [k for k, off in shown if off < 5] == [*range(11), *range(12, 30)]


def test_the_segments_of_a_playlist_are_read(tmp_path):
    parts = [encoded(moving(18)), encoded(moving(18, first=18), begins_s=0.6)]
    with served_as_hls(tmp_path, parts, 1) as address:
        read = all_pictures(address)
    shown = [which(picture.image_rgb) for picture in read]
    assert [k for k, _ in shown] == list(range(36))
    assert max(off for _, off in shown) < 10
    # when they were filmed, though they come all at once
    times = np.array([picture.timestamp_s for picture in read])
    np.testing.assert_allclose(times - times[0], np.arange(36) / 30, atol=0.04)


def test_frames_that_a_relay_sends_at_once_have_the_times_at_which_they_were_filmed():
    """Their format has times; another one has none, so that they have those of their arrival."""
    with pushed(encoded(moving(30), begins_s=70.0)) as address:
        times = [picture.timestamp_s for picture in all_pictures(address)]
    assert len(times) >= 28
    np.testing.assert_allclose(np.diff(times), 1 / 30, atol=1e-3)
    with pushed(encoded(moving(30), "mjpeg", "mjpeg")) as address:
        read = all_pictures(address)
    assert len(read) >= 28
    assert all(picture.timestamp_s == picture.arrived_s for picture in read)


def test_times_of_a_sender_are_used_as_long_as_they_can_be_true():
    sent = SentTimes()
    assert sent.at(100.0, 5.0) == 5.0
    assert sent.at(100.04, 6.5) == pytest.approx(5.04)  # the network was late
    assert sent.at(100.08, 6.5) == pytest.approx(5.08)
    assert sent.at(3.0, 6.7) == pytest.approx(6.7)  # another programme
    assert sent.at(3.04, 6.7) == pytest.approx(6.74)
    assert SentTimes().at(None, 7.0) == 7.0


@pytest.mark.parametrize("counted_s", [0.02, 0.06])
def test_times_that_a_sender_counts_wrongly_neither_go_back_nor_leave_time_out(counted_s):
    sent = SentTimes()
    times = [sent.at(counted_s * k, 0.04 * k) for k in range(1500)]
    steps_s = np.diff(times)
    assert min(steps_s) > 0.0
    assert max(steps_s) < 0.1
    assert steps_s[-1] == pytest.approx(0.04)


def test_another_programme_of_a_stream_is_shown_at_once(tmp_path):
    """Its times go back, or are hours later."""
    data = encoded(moving(6), begins_s=50.0) + encoded(moving(6), begins_s=9.0)
    with served(tmp_path, "a.ts", data + encoded(moving(6), begins_s=9000.0)) as address:
        times = [picture.timestamp_s for picture in all_pictures(address)]
    assert len(times) > 15
    assert max(np.diff(times)) < 0.1


def test_a_playlist_does_not_open_files_of_this_computer(tmp_path):
    """Nor does it say whether they are there."""
    secret = tmp_path / "secret.ts"
    secret.write_bytes(encoded(moving(12)))
    lines = [
        "#EXTM3U",
        "#EXT-X-TARGETDURATION:1",
        "#EXTINF:1.0,",
        secret.as_uri(),
        "#EXT-X-ENDLIST",
        "",
    ]
    with served(tmp_path, "list.m3u8", "\n".join(lines).encode()) as address:
        with pytest.raises(VideoError, match="cannot be opened|was interrupted|carries no video"):
            all_pictures(address)


def test_a_list_that_is_no_playlist_of_a_stream_opens_nothing(tmp_path):
    """FFmpeg knows formats that name any further files and devices."""
    (tmp_path / "part.ts").write_bytes(encoded(moving(12)))
    with served(tmp_path, "list.txt", b"ffconcat version 1.0\nfile part.ts\n") as address:
        with pytest.raises(VideoError, match="cannot be opened"):
            all_pictures(address)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("missing.mp4", "missing.mp4 does not exist; check the path"),
        (
            "10.0.0.7/stream",
            "10.0.0.7/stream does not exist; .* and a stream with its kind, as in rtsp://",
        ),
        (
            "gopher://host/x",
            "'gopher' is not a kind of stream that can be read; use http, https, rtsp",
        ),
        ("file:///etc/passwd", "'file' is not a kind of stream"),
    ],
)
def test_what_is_no_source_is_said(text, message):
    with pytest.raises(VideoError, match=message):
        open_source(text)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="devices of Linux")
def test_a_camera_that_does_not_exist_is_said():
    with pytest.raises(
        VideoError, match="camera 987 does not exist; (choose one of /dev|connect a camera)"
    ):
        open_source("987")


def test_a_server_that_does_not_run_is_said_without_the_password():
    with pytest.raises(
        VideoError,
        match=r"^http://127.0.0.1:9/v cannot be opened \(connection "
        r"refused\); check",
    ):
        next(iter(open_source("http://me:secret@127.0.0.1:9/v").pictures(Clock())))


@pytest.mark.parametrize("address", ["rtsp://camera/x", "http://127.0.0.1:1/v", "UDP://@:5000"])
def test_a_stream_is_refused_without_online_access(address):
    assert is_stream(address)
    with pytest.raises(OfflineError, match="Allow Online Access"):
        open_source(address, online=False)
