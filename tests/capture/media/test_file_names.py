# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that are not UTF-8 are passed on to libraries in a form that they can take, and shown as
text.
"""

import os
import shutil
import subprocess
import sys

import pytest
from scope.scope_addon.capture.media.guards import utf8_name
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.footage import display_text, is_utf8

NAME = os.fsdecode(b"caf\xe9.png")


def test_names_are_shown_as_text_that_can_be_encoded():
    assert display_text("café.png") == "café.png"
    display_text(NAME).encode()
    assert display_text(NAME).startswith("caf")
    assert display_text(NAME).endswith(".png")


@pytest.mark.skipif(sys.platform != "linux", reason="file names are Unicode on this system")
def test_a_file_is_opened_by_a_name_of_its_own_or_of_a_link(tmp_path):
    for name in ("café.png", NAME):
        path = tmp_path / name
        path.write_bytes(name.encode("utf-8", "surrogateescape"))
        with utf8_name(path) as given:
            assert is_utf8(given)
            assert given.endswith(".png")
            with open(given, "rb") as file:
                assert file.read() == path.read_bytes()
        assert path.is_file()


@pytest.mark.skipif(sys.platform != "linux", reason="file names are Unicode on this system")
def test_a_video_is_read_and_an_overlay_written(tmp_path):
    """In a process of its own, which OpenCV would end."""
    video, overlay = (tmp_path / os.fsdecode(name) for name in (b"caf\xe9.mp4", b"\xfcber.mp4"))
    shutil.copy(SAMPLE, video)
    code = """
import sys
from fractions import Fraction
from pathlib import Path
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.media.video_writer import VideoWriter
video, overlay = map(Path, sys.argv[1:])
with open_video(video, VideoRange(end_s=0.1)) as opened:
    images = [frame.image_rgb for frame in opened]
writer = VideoWriter(overlay, Fraction(30), *images[0].shape[1::-1], overlay)
for image in images:
    writer.write(image)
writer.close()
with open_video(overlay, VideoRange()) as opened:
    print(len(images), sum(1 for _ in opened))
"""
    done = subprocess.run(
        [sys.executable, "-c", code, video, overlay], capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.returncode) == ("4 4\n", 0), done.stderr
