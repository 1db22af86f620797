# SPDX-License-Identifier: GPL-3.0-or-later
"""Streams that lose packets on their way: what is shown is what the camera saw, and it goes on with
a key frame.
"""

from functools import cache
from itertools import chain

import numpy as np
import pytest
from scope.scope_addon.live import stream
from scope.scope_addon.live.open_source import open_source
from scope.scope_addon.live.stream import DAMAGED_S

from .fake_source import FakeClock
from .stream_server import encoded, rtp_of_h264, rtsp_server, served, without

GROUP = 10
COUNT = 40
LOST = 13
INTACT = [*range(LOST), *range(2 * GROUP, COUNT)]


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """However long a busy computer does not run a server's thread, its stream does not count as
    interrupted.
    """
    monkeypatch.setattr(stream, "STALLED_S", 300.0)


@cache
def walking(count=COUNT):
    """Grainy pictures of a bar that moves, of which an encoder predicts much, but not everything,
    from those before.

    Their sides are multiples of 16: with 120 rows, x264 encoded the same pictures otherwise once in
    a hundred times.
    """
    random = np.random.default_rng(1)
    grain = random.integers(0, 60, (128, 176, 3))
    pictures = []
    for k in range(count):
        picture = grain + random.integers(0, 60, grain.shape)
        picture[20:100, 4 * k : 4 * k + 24] += 120
        pictures.append(picture.astype(np.uint8))
    return pictures


@cache
def encoded_once(codec):
    """The stream of ``walking``. x264 sometimes encodes the same pictures otherwise, so every test
    has to get the same.
    """
    return encoded(walking(), codec, group=GROUP)


def shown(address, clock=None):
    """The pictures that a stream shows, in the place of those that were left out None."""
    return [
        None if p is None else p.image_rgb
        for p in open_source(address).pictures(clock or FakeClock())
    ]


def served_pictures(tmp_path, data):
    with served(tmp_path, "a.ts", data) as address:
        return shown(address)


@pytest.fixture(scope="module")
def truth_of(tmp_path_factory):
    """``truth_of(codec)``: what the stream shows of which nothing is lost, which all tests compare
    with.
    """
    folder = tmp_path_factory.mktemp("intact")
    return cache(lambda codec: served_pictures(folder, encoded_once(codec)))


@pytest.fixture(scope="module")
def truth_of_camera():
    """``truth_of_camera()``: the same from a network camera."""

    def intact():
        pictures, media = rtp_of_h264(encoded_once("libx264"))
        with rtsp_server(list(chain(*pictures)), media) as address:
            return shown(address)

    return cache(intact)


def numbers(pictures, truth):
    """Of each picture that is shown, the number of the undamaged one that it equals; None: of no
    one.
    """
    known = {true.tobytes(): k for k, true in enumerate(truth)}
    return [known.get(picture.tobytes()) for picture in pictures if picture is not None]


def cut(data, picture, packets):
    """Return a transport stream of H.264 or MPEG without some packets of 188 bytes of one of its
    pictures.

    :param packets: a slice of those of the picture.
    """
    pieces = [data[at : at + 188] for at in range(0, len(data), 188)]
    video = [k for k, piece in enumerate(pieces) if (piece[1] & 31) << 8 | piece[2] == 256]
    begins = [k for k in video if pieces[k][1] & 64]
    end = begins[picture + 1]
    lost = [k for k in video if begins[picture] <= k < end][packets]
    return b"".join(piece for k, piece in enumerate(pieces) if k not in lost)


ALL = slice(None)
MIDDLE = slice(2, 4)
FIRST = slice(0, 2)


@pytest.mark.parametrize(
    ("codec", "packets"),
    [
        *(("libx264", packets) for packets in (ALL, MIDDLE, FIRST)),
        *((codec, MIDDLE) for codec in ("libx265", "mpeg4")),
    ],
)
def test_after_lost_packets_nothing_is_shown_until_the_next_key_frame(
    tmp_path, truth_of, codec, packets
):
    truth = truth_of(codec)
    found = served_pictures(tmp_path, cut(encoded_once(codec), LOST, packets))
    assert numbers(truth, truth) == list(range(COUNT))
    assert numbers(found, truth) in [
        [k for k in INTACT if k not in range(LOST - early, LOST)] for early in range(3)
    ]
    assert any(picture is None for picture in found)


@pytest.mark.parametrize("packets", [ALL, slice(1, 2)], ids=["all", "second"])
def test_a_network_camera_that_loses_packets(truth_of_camera, packets):
    truth = truth_of_camera()
    assert len(truth) > 2 * GROUP
    pictures, media = rtp_of_h264(encoded_once("libx264"))
    assert len(pictures[LOST]) >= 4
    pictures[LOST] = [packet for packet in pictures[LOST] if packet not in pictures[LOST][packets]]
    with rtsp_server(list(chain(*pictures)), media) as address:
        found = shown(address)
    last = len(truth)  # the server hangs up, and the last picture may be incomplete
    assert numbers(found, truth) == [k for k in INTACT if k < last]


def test_a_stream_without_another_key_frame_is_shown_again_after_a_while(tmp_path):
    """Pictures that are a little wrong are better than none."""
    clock = FakeClock()
    times = iter(np.arange(100.0, 200.0, 0.1))
    clock.now = lambda: next(times)
    intact = encoded(walking(60), "libx264", group=400)
    with served(tmp_path, "a.ts", without(intact, [LOST])) as address:
        found = shown(address, clock)
    again = next(k for k in range(LOST, len(found)) if found[k] is not None)
    assert all(picture is not None for picture in found[again:])
    assert 0.1 * (again - LOST) == pytest.approx(DAMAGED_S, abs=0.2)
