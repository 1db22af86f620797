# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of H.264 pictures, as x264 encodes them in several ways: complete streams have no gaps,
others do.
"""

import io
import re

import av
import numpy as np
import pytest
from scope.scope_addon.live.damage import FrameNumbers

from .stream_server import encoded

WAYS = {
    "baseline": ("mpegts", {"profile": "baseline"}, "yuv420p"),
    "high": ("mpegts", {"profile": "high"}, "yuv420p"),
    "in mp4": ("mp4", {"profile": "high"}, "yuv420p"),
    "of all colours": ("mpegts", {"profile": "high444"}, "yuv444p"),
    "scaling lists": ("mpegts", {"profile": "high", "x264-params": "cqm=jvt"}, "yuv420p"),
    "in fields": ("mpegts", {"x264-params": "interlaced=1:fake-interlaced=0"}, "yuv420p"),
    "slices": ("mpegts", {"x264-params": "slices=4"}, "yuv420p"),
    "intra refresh": ("mpegts", {"x264-params": "intra-refresh=1:keyint=50"}, "yuv420p"),
    "two-way": ("mpegts", {"x264-params": "bframes=2:b-adapt=0:keyint=50:open-gop=1"}, "yuv420p"),
}


def packets_of(way, count=80):
    """The packets of a stream, and its extradata."""
    kind, options, pixels = WAYS[way]
    pictures = np.random.default_rng(0).integers(0, 255, (count, 64, 64, 3), np.uint8)
    how = {"preset": "ultrafast", "bf": "0"} | options
    data = encoded(pictures, "libx264", kind, group=250, pixels=pixels, **how)
    with av.open(io.BytesIO(data)) as container:
        stream = container.streams.video[0]
        packets = [packet for packet in container.demux(stream) if packet.dts is not None]
        return [bytes(packet) for packet in packets], stream.codec_context.extradata


def is_built_on(packet):
    """Whether other pictures build on one: the two bits before the type of its slices."""
    slices = re.findall(rb"\x00\x00\x01([\x01\x21\x41\x61\x65])", packet)
    return any(each[0] & 0x60 for each in slices)


@pytest.mark.parametrize("way", WAYS)
def test_a_complete_stream_has_no_gaps_and_losses_are_found(way):
    packets, extradata = packets_of(way)
    numbers = FrameNumbers(extradata)
    assert not any(numbers.has_gap(packet) for packet in packets)
    assert all(numbers.has_picture(packet) for packet in packets)
    for lost in (20, 21, 22, 23, 65):
        numbers = FrameNumbers(extradata)
        left = [(k, numbers.has_gap(packet)) for k, packet in enumerate(packets) if k != lost]
        expected = [lost + 1] if way == "in mp4" or is_built_on(packets[lost]) else []
        assert [k for k, is_gap in left if is_gap] == expected


@pytest.mark.parametrize("way", ["in mp4", "scaling lists"])
def test_damaged_data_is_no_error(way):
    packets, extradata = packets_of(way, 30)
    random = np.random.default_rng(2)
    for _ in range(100):
        broken = []
        for data in (extradata, *packets[:3]):
            values = np.frombuffer(data[: random.integers(0, len(data) + 1)], np.uint8).copy()
            where = random.integers(0, max(len(values), 1), 4)
            values[where[where < len(values)]] = random.choice([0, 1, 3, 255, 0x67, 0x65])
            broken.append(values.tobytes())
        numbers = FrameNumbers(broken[0])
        for data in broken[1:]:
            numbers.has_gap(data)
            numbers.has_picture(data)
