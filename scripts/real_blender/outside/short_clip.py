# SPDX-License-Identifier: GPL-3.0-or-later
"""Copy the first seconds of a clip, without encoding it again, and all of it as JPEG pictures.

A capture of the seconds is enough for the parts that try what surrounds a capture;
``mjpeg_camera.py`` serves the pictures. Usage: ``short_clip.py CLIP TARGET PICTURES``
"""

from __future__ import annotations

import sys
from pathlib import Path

import av
import cv2

FRAMES = 75
HEIGHT = 720


def main(clip: str, target: str, pictures: str) -> None:
    """Write both."""
    copy_beginning(clip, target)
    folder = Path(pictures)
    folder.mkdir()
    with av.open(clip) as source:
        for index, frame in enumerate(source.decode(video=0)):
            width = round(HEIGHT * frame.width / frame.height)
            cv2.imwrite(
                str(folder / f"{index:04d}.jpg"),
                frame.reformat(width, HEIGHT, "bgr24").to_ndarray(),
            )


def copy_beginning(clip: str, target: str) -> None:
    """Copy the packets of the first frames."""
    with av.open(clip) as source, av.open(target, "w") as copy:
        stream = source.streams.video[0]
        out = copy.add_stream_from_template(stream)
        for packet in source.demux(stream):
            if packet.pts is None or packet.pts * stream.time_base >= FRAMES / stream.average_rate:
                continue
            packet.stream = out
            copy.mux(packet)


if __name__ == "__main__":
    main(*sys.argv[1:])
