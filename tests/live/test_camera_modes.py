# SPDX-License-Identifier: GPL-3.0-or-later
"""The modes of a camera, from lines as FFmpeg's dshow.c and avfoundation.m put them together."""

from __future__ import annotations

import pytest
from scope.scope_addon.live.system_cameras import (
    Mode,
    described,
    nearest_mode,
    parse_modes,
)

HD = (1280, 720)


def dshow(format, least, most, of=None, after=""):
    """A line of `dshow_cycle_formats`: the format, "  min s=%ldx%ld fps=%g max s=%ldx%ld fps=%g",
    and colours."""
    low, high = of or ((640, 480), (640, 480))
    # %g of C is Python's
    sizes = f"  min s={low[0]}x{low[1]} fps={least:g} max s={high[0]}x{high[1]} fps={most:g}"
    return f"  {format}{sizes}{after}\n"


# Lines before the modes, and after each: `dshow_cycle_pins`, `av_color_range_name` and the others.
DSHOW = (
    "DirectShow video device options (from video devices)\n"
    ' Pin "Capture" (alternative pin name "0")\n'
    + dshow("pixel_format=yuyv422", 5, 30)
    + dshow("pixel_format=yuyv422", 5, 10, (HD, HD), " (tv, bt470bg/bt709/unknown, topleft)")
    + dshow("vcodec=mjpeg", 5, 30, (HD, HD), " (pc, bt470bg/bt709/unknown)")
    + dshow("vcodec=mjpeg", 5, 30, (HD, HD), "(topleft)")
    + dshow("vcodec=mjpeg", 29.97, 60.0002, ((160, 120), (1920, 1080)))
    + dshow("unknown compression type 0x30313050", 5, float("inf"))
)
# `configure_video_device`: "  %dx%d@[%f %f]fps\n" for each rate of each format; many have
# the same.
MODES = [
    (1920, 1080, 15, 30),
    (1920, 1080, 15, 30),
    (640, 480, 1, 60.00024),
    (1280, 720, 24, 24),
    (1280, 720, 1, 60),
]
AVFOUNDATION = (
    "Selected video size (1x1) is not supported by the device.\nSupported modes:\n"
    + "".join(
        f"  {width}x{height}@[{least:f} {most:f}]fps\n" for width, height, least, most in MODES
    )
)


def test_dshow_tells_formats_sizes_and_rates():
    modes = parse_modes(DSHOW, "dshow")
    assert modes == [
        Mode("yuyv422", (640, 480), (640, 480), 5, 30),
        Mode("yuyv422", HD, HD, 5, 10),
        Mode("mjpeg", HD, HD, 5, 30),
        Mode("mjpeg", (160, 120), (1920, 1080), 29.97, 60.0002),
        Mode("0x30313050", (640, 480), (640, 480), 5, 1000),
    ]
    assert described(modes) == ["yuyv422 1280×720", "mjpeg 1920×1080", "0x30313050 640×480"]


@pytest.mark.parametrize(
    "line",
    [
        "  vcodec=mjpeg  min s=640x480 fps=5",  # cut off
        "  vcodec=mjpeg  min s=640x480 fps=nan max s=640x480 fps=30",
        "  vcodec=mjpeg  min s=640x480 fps=1e+ max s=640x480 fps=30",
        # the greatest rate below the least
        "  vcodec=mjpeg  min s=640x480 fps=30 max s=640x480 fps=5",
        "  vcodec=mjpeg  min s=640x480 fps=0 max s=640x480 fps=0",
        "  vcodec=mjpeg  min s=640x480 fps=5 max s=320x240 fps=30",
        "  vcodec=mjpeg  min s=99999x99999 fps=5 max s=99999x99999 fps=30",
        "  vcodec=\x1b[2J  min s=640x480 fps=5 max s=640x480 fps=30",
        f"  vcodec={'m' * 5000}  min s=640x480 fps=5 max s=640x480 fps=30",
        "  vcodec=mjpeg  min s=٦٤٠x480 fps=5 max s=640x480 fps=30",  # digits, but not FFmpeg's
        ' Pin "  vcodec=mjpeg  min s=640x480 fps=5 max s=640x480 fps=30" (alternative pin name '
        '"0")',
        "  min ch=1 bits=8 rate= 11025 max ch=2 bits=16 rate= 44100",  # of a microphone
        "  1280x720@[30.000000 15.000000]fps",
        "  1280x720@[15.000000 30.000000]fps<script>",
    ],
)
@pytest.mark.parametrize("kind", ["dshow", "avfoundation"])
def test_what_is_no_mode_is_left_out(line, kind):
    known = DSHOW if kind == "dshow" else AVFOUNDATION
    assert parse_modes(f"{line}\n{known}", kind) == parse_modes(known, kind)
    assert parse_modes(line, kind) == []


def test_the_mode_to_ask_for_is_the_one_nearest_to_720p_and_30_frames_per_second():
    chosen = nearest_mode(parse_modes(AVFOUNDATION, "avfoundation"), HD)
    assert (chosen.most, chosen.fps) == (HD, 24.0)
    chosen = nearest_mode(parse_modes(DSHOW, "dshow"), HD)
    assert (chosen.format, chosen.nearest_size(HD), chosen.fps) == ("mjpeg", HD, 30.0)
    small = Mode("mjpeg", (320, 240), (640, 480), 5, 15)
    assert (nearest_mode([small], HD).nearest_size(HD), small.fps) == ((640, 480), 15)
    assert nearest_mode([], HD) is None
