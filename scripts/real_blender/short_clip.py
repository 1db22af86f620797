# SPDX-License-Identifier: GPL-3.0-or-later
"""Copy the first seconds of a clip, without encoding it again: ``short_clip.py CLIP TARGET``.

A capture of them is enough for the parts that try what surrounds a capture.
"""

from __future__ import annotations

import sys

import av

FRAMES = 75


def main(clip: str, target: str) -> None:
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
