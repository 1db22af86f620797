# SPDX-License-Identifier: GPL-3.0-or-later
"""Footage that lasts longer than any test."""

from __future__ import annotations

from pathlib import Path

import av
from scope.scope_addon.cli import SAMPLE


def played_again_and_again(path: Path, rounds: int = 60) -> str:
    """Write the sample clip's packets in rounds of five seconds, and return the path."""
    with av.open(str(path), "w") as target:
        stream = None
        for number in range(rounds):
            with av.open(str(SAMPLE)) as source:
                shown = source.streams.video[0]
                assert shown.duration is not None
                stream = stream or target.add_stream_from_template(shown)
                for packet in source.demux(shown):
                    if packet.size and packet.pts is not None:
                        packet.pts += number * shown.duration
                        packet.dts = packet.pts
                        packet.stream = stream
                        target.mux(packet)
    return str(path)
