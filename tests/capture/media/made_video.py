# SPDX-License-Identifier: GPL-3.0-or-later
"""Small video files, and changes of their headers."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np

from ...required import package

av = package("av")


def write_video(
    path: Path, images: list[np.ndarray], fps: float = 30.0, codec: str = "mp4v"
) -> Path:
    height, width = images[0].shape[:2]
    writer = cv2.VideoWriter(
        str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec), fps, (width, height)
    )
    assert writer.isOpened()
    for image in images:
        writer.write(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    writer.release()
    return path


def write_film(
    path: Path,
    pictures: Iterable,
    codec: str,
    pixels: str = "yuv420p",
    rate: int = 25,
    *,
    times_s: Sequence[float] | None = None,
    metadata: dict[str, str] | None = None,
    options: dict[str, str] | None = None,
) -> Path:
    """Encode pictures (H, W, 3), or frames, with the tags of the first one.

    :param pixels: their form in the file.
    :param times_s: when each is shown; None: picture k at k / rate.
    """
    frames = [
        picture if hasattr(picture, "pts") else av.VideoFrame.from_ndarray(picture, format="rgb24")
        for picture in pictures
    ]
    with av.open(str(path), "w", options={"movflags": "use_metadata_tags"}) as container:
        container.metadata.update(metadata or {})
        stream = container.add_stream(codec, rate=rate, options=options or {})
        context = stream.codec_context
        stream.width = frames[0].width
        stream.height = frames[0].height
        stream.pix_fmt = pixels
        context.thread_count = 1
        for tag in ("color_trc", "color_primaries", "colorspace", "color_range"):
            setattr(context, tag, getattr(frames[0], tag))
        ticks = rate if times_s is None or path.suffix == ".avi" else 1000  # AVI has whole frames
        stream.time_base = context.time_base = Fraction(1, ticks)
        for k, frame in enumerate(frames):
            shown = frame if frame.format.name == pixels else frame.reformat(format=pixels)
            shown.pts = k if times_s is None else round(ticks * times_s[k])
            shown.time_base = Fraction(1, ticks)
            container.mux(stream.encode(shown))
        container.mux(stream.encode(None))
    return path


def sound_track(path: Path, cover: np.ndarray | None = None) -> Path:
    """Write an .mp4 of a silent second alone, or with the picture of a cover."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=8000)
        silence = np.zeros((1, 8000), np.float32)
        sound = av.AudioFrame.from_ndarray(silence, format="fltp", layout="mono")
        sound.rate = 8000
        if cover is not None:
            height, width = cover.shape[:2]
            picture = container.add_stream("mjpeg", width=width, height=height, pix_fmt="yuvj420p")
            picture.disposition = av.stream.Disposition.attached_pic
        for packet in [*stream.encode(sound), *stream.encode()]:
            container.mux(packet)
        if cover is not None:
            frame = av.VideoFrame.from_ndarray(cover, format="rgb24")
            for packet in [*picture.encode(frame), *picture.encode()]:
                container.mux(packet)
    return path


def replace_mp4_box(data: bytes, path: tuple[bytes, ...], payload: bytes) -> bytes:
    """Replace the payload of the box at ``path`` and correct the sizes of the boxes around it.

    Only for files whose sample data lies before the index, as OpenCV writes them: offsets then stay
    true.
    """
    at = 0
    end = len(data)
    outer = []
    for name in path:
        while data[at + 4 : at + 8] != name:
            at += struct.unpack_from(">I", data, at)[0]
            assert at < end
        outer.append(at)
        end = at + struct.unpack_from(">I", data, at)[0]
        at += 8
    grown = bytearray(data[:at] + payload + data[end:])
    for start in outer:
        size = struct.unpack_from(">I", data, start)[0]
        struct.pack_into(">I", grown, start, size + len(payload) - (end - at))
    return bytes(grown)


TRACK = (b"moov", b"trak")
TABLE = (*TRACK, b"mdia", b"minf", b"stbl")


def with_time_table(path: Path, timescale: int, steps: list[tuple[int, int]]) -> None:
    """Give an .mp4 a clock of ``timescale`` ticks per second and (count, ticks) frame durations."""
    data = path.read_bytes()
    duration = sum(n * d for n, d in steps)
    header = struct.pack(">IIIIIHH", 0, 0, 0, timescale, duration, 0x55C4, 0)
    data = replace_mp4_box(data, (*TRACK, b"mdia", b"mdhd"), header)
    table = struct.pack(">II", 0, len(steps)) + b"".join(struct.pack(">II", *s) for s in steps)
    data = replace_mp4_box(data, (*TABLE, b"stts"), table)
    # without the edit list, whose duration is the old one
    path.write_bytes(data.replace(b"edts", b"free"))


def patch_track_header(
    path: Path, matrix: tuple[int, ...] | None = None, width: int | None = None
) -> None:
    """Write the display matrix (rotation) and the display width (pixel aspect) of an .mp4."""
    data = bytearray(path.read_bytes())
    at = data.find(b"tkhd") + 4 + 40
    if matrix:
        struct.pack_into(">9i", data, at, *matrix)
    if width:
        struct.pack_into(">I", data, at + 36, width << 16)
    path.write_bytes(data)
