# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that would take all memory or time are refused by their headers, and so are lists of other files."""

import struct
import subprocess
import sys
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.frame_readers import PyavReader, presented_duration_s
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.errors import VideoError

from .made_video import patch_track_header, write_video

READ = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.errors import VideoError
try:
    print(open_video(sys.argv[1]).width)
except VideoError as error:
    print(error)
"""


def png(width: int, height: int, rows: int) -> bytes:
    """An RGBA image of zeros whose data may end early."""
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0))]
    chunks += [(b"IDAT", zlib.compress(bytes((1 + 4 * width) * rows), 1)), (b"IEND", b"")]
    made = [struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in chunks]
    return b"\x89PNG\r\n\x1a\n" + b"".join(made)


def test_an_image_of_too_many_pixels_is_refused_before_it_is_decoded(tmp_path):
    path = tmp_path / "bomb.png"
    path.write_bytes(png(20_000, 20_000, 10))
    done = subprocess.run([sys.executable, "-c", READ, path], capture_output=True, text=True, check=True)
    assert (
        done.stdout.strip()
        == f"{path} has too many pixels, and at most 134 million can be read; scale it down, or crop it"
    )


def test_a_large_transparent_image_takes_little_memory(tmp_path):
    """Of 36 million pixels: 144 MB, and some 1.2 GB as numbers with a fraction."""
    path = tmp_path / "large.png"
    path.write_bytes(png(6000, 6000, 6000))
    read = READ.replace("3 << 30", "1536 << 20")
    done = subprocess.run([sys.executable, "-c", read, path], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "6000"


@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
@pytest.mark.parametrize("claimed", [1 << 30, (1 << 32) - 1])
def test_a_chunk_larger_than_its_file_takes_no_memory(tmp_path, claimed):
    """OpenCV would reserve, and fill, as much as the chunk claims."""
    whole = png(32, 24, 24)
    at = whole.index(b"IDAT") - 4
    path = tmp_path / "chunk.png"
    path.write_bytes(whole[:at] + struct.pack(">I", claimed) + whole[at + 4 :])
    read = f"{READ}print(open('/proc/self/status').read().split('VmHWM:')[1].split()[0])"  # kB
    done = subprocess.run([sys.executable, "-c", read, path], capture_output=True, text=True, check=True)
    message, peak = done.stdout.splitlines()
    assert "cannot be decoded; it may be damaged" in message
    assert int(peak) < 600_000


def test_what_follows_the_end_of_an_image_is_ignored(tmp_path):
    path = tmp_path / "tail.png"
    path.write_bytes(png(32, 24, 24) + b"\xff" * 100)
    assert open_video(path).width == 32


@pytest.mark.parametrize(("width", "height"), [(4000, 2), (3, 20_000), (410, 20), (20, 401)])
def test_an_image_that_is_too_long_is_refused(tmp_path, width, height):
    path = tmp_path / "long.png"
    cv2.imwrite(str(path), np.zeros((height, width, 3), np.uint8))
    with pytest.raises(VideoError, match=rf"long\.png shows {width} × {height} pixels.*at most 20 times.*crop it"):
        open_video(path)


@pytest.mark.parametrize(("width", "height"), [(400, 20), (20, 400), (1, 1)])
def test_an_image_up_to_that_length_is_read(tmp_path, width, height):
    path = tmp_path / "long.png"
    cv2.imwrite(str(path), np.zeros((height, width, 3), np.uint8))
    assert (open_video(path).width, open_video(path).height) == (width, height)


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
    assert presented_duration_s(path) is None
    with pytest.raises(VideoError, match=r"list\.mp4 is not a video or image that can be decoded"):
        PyavReader(path)
