# SPDX-License-Identifier: GPL-3.0-or-later
"""Small video files, and changes of their headers."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np


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
