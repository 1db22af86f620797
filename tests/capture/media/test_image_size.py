# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that would take all memory or time are refused by their headers, and so are lists of other
files.
"""

import struct
import subprocess
import sys
import tracemalloc
import zlib
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media import frame_readers, guards
from scope.scope_addon.capture.media.frame_readers import PyavReader
from scope.scope_addon.capture.media.still_images import read_picture
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.perception.person_detector import PersonDetector
from scope.scope_addon.capture.tracking.tracker import PeopleTracker
from scope.scope_addon.errors import VideoError

from .made_video import patch_track_header, write_video

MAX_DETECTOR_RUNS = 600  # of one image; of 16:9 there are 48
READ = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.errors import VideoError
for path in sys.argv[1:]:
    try:
        print(open_video(path).width)
    except VideoError as error:
        print(error)
print(open("/proc/self/status").read().split("VmHWM:")[1].split()[0])  # kB
"""


def png(width: int, height: int, rows: int) -> bytes:
    """An RGBA image of zeros whose data may end early."""
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0))]
    chunks += [(b"IDAT", zlib.compress(bytes((1 + 4 * width) * rows), 1)), (b"IEND", b"")]
    made = [
        struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in chunks
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(made)


@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
def test_a_chunk_larger_than_its_file_takes_no_memory(tmp_path):
    """OpenCV would reserve, and fill, as much as the chunk claims: up to 4.3 GB."""
    whole = png(32, 24, 24)
    at = whole.index(b"IDAT") - 4
    for name, chunk in {
        "1 GB": struct.pack(">I", 1 << 30) + whole[at + 4 :],
        "4 GB": struct.pack(">I", (1 << 32) - 1) + whole[at + 4 :],
        "of a chunk without a name": struct.pack(">I", 3 << 30),
        "of the end": struct.pack(">I", 3 << 30) + b"IEND" + bytes(4),
    }.items():
        (tmp_path / f"{name}.png").write_bytes(whole[:at] + chunk)
    done = subprocess.run(
        [sys.executable, "-c", READ, *sorted(tmp_path.iterdir())],
        capture_output=True,
        text=True,
        check=True,
    )
    *messages, peak = done.stdout.splitlines()
    assert ["cannot be decoded; it may be damaged" in message for message in messages] == [True] * 4
    assert int(peak) < 600_000


def tiff(path: Path, dtype: type, side: int) -> Path:
    """A TIFF of a few pixels, whose header declares a square of more."""
    cv2.imwrite(str(path), np.zeros((16, 16, 4), dtype))
    data = bytearray(path.read_bytes())
    start = struct.unpack_from("<I", data, 4)[0]
    for at in range(start + 2, start + 2 + 12 * struct.unpack_from("<H", data, start)[0], 12):
        if struct.unpack_from("<H", data, at)[0] in (0x0100, 0x0101):
            struct.pack_into("<HII", data, at + 2, 4, 1, side)
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("dtype", "side"), [(np.uint16, 11_585), (np.float32, 5792), (np.float64, 4096)]
)
def test_a_deep_image_may_have_fewer_pixels(tmp_path, dtype, side):
    """134 million pixels of four channels take 2.2 GB at 16 bits, and took 17 GB at 64."""
    with pytest.raises(VideoError, match="cannot be decoded"):  # its content is missing
        open_video(tiff(tmp_path / "deep.tiff", dtype, side))
    with pytest.raises(
        VideoError,
        match=r"deep\.tiff has (too many|\d+ × \d+) pixels.*at most 134 "
        r"million",
    ):
        open_video(tiff(tmp_path / "deep.tiff", dtype, side + 1))


@pytest.mark.parametrize(("name", "dtype"), [("a.png", np.uint8), ("a.tiff", np.float32)])
def test_a_large_image_is_converted_in_little_memory(tmp_path, name, dtype):
    """Converted as a whole, it takes four times as much as decoded, and a transparent one nine
    times.
    """
    path = tmp_path / name
    one = 255 if dtype is np.uint8 else 1.0
    levels = (one * np.linspace(0, 1, 1500)).astype(dtype)
    cv2.imwrite(str(path), np.repeat(levels, 4 * 1500).reshape(1500, 1500, 4))
    tracemalloc.start()
    picture = read_picture(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 3.5 * 1500**2 * 4 * dtype().itemsize
    # on white, as the fourth channel is its opacity
    opacity = levels / one
    shown = opacity * np.round(255 * opacity) + 255 * (1 - opacity)
    np.testing.assert_allclose(picture.rgb[:, 0, 0], shown, atol=1.5)


def test_a_frame_larger_than_its_container_says_is_not_decoded(tmp_path, monkeypatch):
    path = tmp_path / "larger.mp4"
    picture = cv2.imencode(".jpg", np.zeros((480, 640, 3), np.uint8))[1].tobytes()
    with av.open(str(path), "w") as out:
        stream = out.add_stream("mjpeg", rate=10)
        stream.width = 64
        stream.height = 48
        stream.pix_fmt = "yuvj420p"
        for k in range(2):
            packet = av.Packet(picture)
            packet.stream = stream
            packet.pts = k
            packet.dts = k
            out.mux(packet)
    assert open_video(path).width == 640
    monkeypatch.setattr(frame_readers, "MAX_PIXELS", 640 * 480 - 1)
    with pytest.raises(VideoError, match="none of its frames can be decoded"):
        open_video(path)


def test_a_file_of_any_size_is_not_read(tmp_path):
    path = tmp_path / "sparse.bmp"
    with path.open("wb") as file:
        file.write(b"BM")
        file.truncate(8 << 27 | 1)
    with pytest.raises(VideoError, match=r"sparse\.bmp has 1024 MiB, too large for a picture"):
        open_video(path)


def test_what_follows_the_end_of_an_image_is_ignored(tmp_path):
    path = tmp_path / "tail.png"
    path.write_bytes(png(32, 24, 24) + b"\xff" * 100)
    assert open_video(path).width == 32


@pytest.mark.parametrize(("width", "height"), [(3, 20_000), (410, 20)])
def test_an_image_that_is_too_long_is_refused(tmp_path, width, height):
    path = tmp_path / "long.png"
    cv2.imwrite(str(path), np.zeros((height, width, 3), np.uint8))
    with pytest.raises(
        VideoError,
        match=rf"long\.png shows {width} × {height} pixels.*at most 20 "
        rf"times.*crop it",
    ):
        open_video(path)


@pytest.mark.parametrize(("width", "height"), [(400, 20), (20, 400), (1, 1)])
def test_an_image_up_to_that_length_is_read(tmp_path, width, height):
    path = tmp_path / "long.png"
    cv2.imwrite(str(path), np.zeros((height, width, 3), np.uint8))
    assert (open_video(path).width, open_video(path).height) == (width, height)


def test_a_video_with_too_many_pixels_is_refused(tmp_path, monkeypatch):
    path = write_video(tmp_path / "large.mp4", [np.zeros((48, 64, 3), np.uint8)] * 2)
    monkeypatch.setattr(guards, "MAX_PIXELS", 64 * 48 - 1)
    with pytest.raises(VideoError, match=r"large\.mp4 has 64 × 48 pixels"):
        open_video(path)


@pytest.mark.parametrize("display_width", [64 * 255, 64 * 16])
def test_a_video_whose_pixels_are_too_wide_is_refused(tmp_path, display_width):
    path = write_video(tmp_path / "wide.mp4", [np.zeros((48, 64, 3), np.uint8)] * 2)
    patch_track_header(path, None, display_width)
    for open_file in (open_video, PyavReader):
        with pytest.raises(VideoError, match=r"wide\.mp4 shows \d+ × 48 pixels"):
            open_file(path)


@pytest.mark.parametrize(
    "text",
    [
        "ffconcat version 1.0\nfile inner.mp4\n",
        "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\ninner.mp4\n#EXT-X-ENDLIST\n",
        '<?xml version="1.0"?>\n<MPD xmlns="urn:mpeg:dash:schema:mpd:2011"></MPD>',
        "\ufeff\n#EXTM3U\ninner.mp4\n",
    ],
)
def test_a_list_of_other_files_is_no_footage(tmp_path: Path, text: str) -> None:
    write_video(tmp_path / "inner.mp4", [np.zeros((48, 64, 3), np.uint8)] * 2)
    path = tmp_path / "list.mp4"
    path.write_text(text)
    with pytest.raises(VideoError, match=r"list\.mp4 is a playlist or other text, not footage"):
        open_video(path)
    with pytest.raises(VideoError, match=r"list\.mp4 is not a video or image that can be decoded"):
        PyavReader(path)


def test_runs_of_the_detector_are_bounded(networks, monkeypatch):
    """The longest picture that is accepted, 20:1, in which nobody is found, so that everywhere is
    searched.
    """
    corners = []

    def detect_in(_, *given):
        corners.append(given[-1])
        return []

    monkeypatch.setattr(PersonDetector, "_detect_in", detect_in)
    assert PeopleTracker("fast", 1).step(np.zeros((500, 25, 3), np.uint8)) == []
    assert 200 < len(corners) <= MAX_DETECTOR_RUNS
