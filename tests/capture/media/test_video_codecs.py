# SPDX-License-Identifier: GPL-3.0-or-later
"""Codecs of phones, cameras and editors: files encoded by Blender, in one process."""

import os
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.errors import VideoError

WIDTH = 320
HEIGHT = 192
FRAMES = 12
RATE = 25
CODECS = {  # container, codec, suffix, bits a colour
    "h264": ("MPEG4", "H264", "mp4", 8),
    "h265": ("MPEG4", "H265", "mp4", 8),
    "h265_10bit": ("MPEG4", "H265", "mp4", 10),
    "vp9": ("WEBM", "WEBM", "webm", 8),
    "av1": ("MPEG4", "AV1", "mp4", 8),
    "prores": ("QUICKTIME", "PRORES", "mov", 8),
    "mpeg4_avi": ("AVI", "MPEG4", "avi", 8),
    "ffv1": ("MKV", "FFV1", "mkv", 8),
}
# One colour strip a frame; what this Blender cannot encode is left out.
ENCODE = f"""
import os, sys
import bpy
scene, folder = bpy.context.scene, sys.argv[-1]
render = scene.render
render.resolution_x, render.resolution_y, render.resolution_percentage = {WIDTH}, {HEIGHT}, 100
render.fps, scene.frame_start, scene.frame_end = {RATE}, 1, {FRAMES}
scene.view_settings.view_transform = "Standard"
editor = scene.sequence_editor_create()
strips = editor.strips if hasattr(editor, "strips") else editor.sequences
last = {{"length": 1}} if bpy.app.version >= (5, 0, 0) else {{"frame_end": 0}}
for k in range({FRAMES}):
    if "frame_end" in last:
        last["frame_end"] = k + 2
    strip = strips.new_effect(name=str(k), type="COLOR", channel=1, frame_start=k + 1, **last)
    strip.color = (k / {FRAMES}, 0.5, 1 - k / {FRAMES})
settings = render.image_settings
if hasattr(settings, "media_type"):
    settings.media_type = "VIDEO"
settings.file_format = "FFMPEG"
for name, (container, codec, suffix, bits) in {CODECS!r}.items():
    try:
        render.ffmpeg.format, render.ffmpeg.codec = container, codec
        settings.color_depth = str(bits)
        render.filepath = os.path.join(folder, name + "." + suffix)
        bpy.ops.render.render(animation=True)
    except (TypeError, RuntimeError) as error:
        print(name, error, file=sys.stderr)
sys.stderr.flush()
os._exit(0)
"""


@pytest.fixture(scope="module")
def encoded():
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", ENCODE, folder]
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env=dict(os.environ)
        )
        yield Path(folder), done.stderr


def colours(path):
    """Read the time and the middle pixel of every frame."""
    with open_video(path) as video:
        assert (video.width, video.height) == (WIDTH, HEIGHT)
        frames = list(video)
    middle = np.array([f.image_rgb[HEIGHT // 2, WIDTH // 2] for f in frames], int)
    return np.array([f.timestamp_s for f in frames]), middle


@pytest.mark.parametrize("name", CODECS)
def test_every_frame_has_its_colour_and_time(encoded, name):
    folder, errors = encoded
    path = folder / f"{name}.{CODECS[name][2]}"
    if not path.is_file() or not path.stat().st_size:
        pytest.skip(f"this Blender does not encode {name}: {errors[-200:]}")
    times, seen = colours(path)
    np.testing.assert_allclose(times - times[0], np.arange(FRAMES) / RATE, atol=2e-3)
    # Red rises and blue falls from frame to frame, green stays: no frame is missing, twice, or in
    # another's place.
    assert (np.diff(seen[:, 0]) > 3).all(), seen
    assert (np.diff(seen[:, 2]) < -3).all(), seen
    assert np.ptp(seen[:, 1]) < 35


def test_av1_range(encoded):
    path = encoded[0] / "av1.mp4"
    if not path.is_file() or not path.stat().st_size:
        pytest.skip(f"this Blender does not encode AV1: {encoded[1][-200:]}")
    with open_video(path, VideoRange(start_s=0.19, end_s=0.33)) as video:
        assert (video.fps, video.frame_count) == (RATE, FRAMES)
        frames = list(video)
    assert [f.index for f in frames] == [5, 6, 7, 8]
    damaged = path.with_name("damaged.mp4")
    damaged.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(VideoError, match="convert"), open_video(damaged) as video:
        list(video)


def gif(frames, delays):
    """Build a GIF of (T, H, W) images with up to 128 grey levels; delays in hundredths of a second.
    Not compressed: the table of codes is cleared before it could grow.
    """
    height, width = frames.shape[1:]
    grey = b"".join(bytes([2 * k] * 3) for k in range(128))
    out = [b"GIF89a", struct.pack("<HHBBB", width, height, 0xF6, 0, 0), grey]
    for frame, delay in zip(frames, delays, strict=True):
        codes = (
            b"".join(
                b"\x80" + frame.ravel()[k : k + 120].tobytes() for k in range(0, frame.size, 120)
            )
            + b"\x81"
        )
        blocks = b"".join(
            bytes([len(b)]) + b for b in (codes[k : k + 255] for k in range(0, len(codes), 255))
        )
        out += [b"\x21\xf9\x04\x04", struct.pack("<H", delay), b"\x00\x00"]
        out += [b"\x2c", struct.pack("<HHHHB", 0, 0, width, height, 0), b"\x07", blocks, b"\x00"]
    return b"".join([*out, b"\x3b"])


def test_gif_with_its_own_delays(tmp_path):
    pictures = np.repeat(np.arange(5, dtype=np.uint8)[:, None, None] * 20, 48, 1).repeat(64, 2)
    (tmp_path / "a.gif").write_bytes(gif(pictures, [10, 10, 40, 10, 10]))
    with open_video(tmp_path / "a.gif") as video:
        frames = list(video)
    assert [int(f.image_rgb[24, 32, 0]) // 2 for f in frames] == [0, 20, 40, 60, 80]
    times = np.array([f.timestamp_s for f in frames])
    np.testing.assert_allclose(times - times[0], [0.0, 0.1, 0.2, 0.6, 0.7], atol=0.011)
