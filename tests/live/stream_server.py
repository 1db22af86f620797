# SPDX-License-Identifier: GPL-3.0-or-later
"""Streams as servers give them: files and playlists over HTTP, and RTP packets, which RTSP sends
over its own connection if it is asked to (RFC 2326, "interleaved").
"""

import io
import struct
from contextlib import contextmanager, suppress
from fractions import Fraction
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
from socketserver import StreamRequestHandler, ThreadingTCPServer
from threading import Thread

import av

DATAGRAM = 1316  # bytes of an RTP packet's content
_WITHOUT_SCENE_CUTS = {
    "libx264": {"sc_threshold": "0"},
    "libx265": {"x265-params": "scenecut=0:log-level=none"},
}


@contextmanager
def served(folder, name, data):
    """Serve bytes over HTTP; gives the address."""
    (folder / name).write_bytes(data)

    class Handler(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    with (
        ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=str(folder))) as server,
        _running(server) as port,
    ):
        yield f"http://127.0.0.1:{port}/{name}"


@contextmanager
def pushed(data):
    """Send bytes to whoever connects, all at once; gives the address."""

    class Handler(StreamRequestHandler):
        def handle(self):
            with suppress(OSError):
                self.wfile.write(data)

    with ThreadingTCPServer(("127.0.0.1", 0), Handler) as server, _running(server) as port:
        yield f"tcp://127.0.0.1:{port}"


def encoded(
    images,
    codec="mpeg2video",
    kind="mpegts",
    group=10,
    begins_s=0.0,
    pixels="yuv420p",
    **how,
):
    """Return RGB images as a stream whose key frames are ``group`` frames apart.

    :param how: options of the encoder.
    """
    target = io.BytesIO()
    with av.open(target, "w", format=kind) as container:
        stream = container.add_stream(codec, rate=30)
        stream.height, stream.width = images[0].shape[:2]
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else pixels
        stream.bit_rate = 4_000_000
        stream.gop_size = group
        stream.max_b_frames = 0
        stream.options = how or _WITHOUT_SCENE_CUTS.get(codec, {})
        for k, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.time_base = Fraction(1, 30)
            frame.pts = round(begins_s * 30) + k
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return target.getvalue()


def without(data, numbers):
    """Return a stream without its packets of these numbers, of whose loss it says nothing
    itself.
    """
    target = io.BytesIO()
    with (
        av.open(io.BytesIO(data)) as source,
        av.open(target, "w", format="mpegts") as container,
    ):
        stream = container.add_stream_from_template(source.streams.video[0])
        for k, packet in enumerate(source.demux(video=0)):
            if packet.dts is not None and k not in numbers:
                packet.stream = stream
                container.mux(packet)
    return target.getvalue()


def nal_units(data):
    """Return the NAL units of each packet of an H.264 stream."""
    with av.open(io.BytesIO(data)) as source:
        packets = [bytes(packet) for packet in source.demux(video=0) if packet.dts is not None]
    return [[unit.rstrip(b"\0") for unit in packet.split(b"\0\0\1")[1:]] for packet in packets]


@contextmanager
def _running(server):
    """Run a server meanwhile."""
    server.daemon_threads = True
    thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        thread.join()


@contextmanager
def served_as_hls(folder, parts, seconds):
    """Serve transport streams as the segments of an HLS playlist; gives its address."""
    lines = [
        "#EXTM3U",
        "#EXT-X-VERSION:3",
        f"#EXT-X-TARGETDURATION:{seconds}",
        "#EXT-X-MEDIA-SEQUENCE:0",
    ]
    for number, part in enumerate(parts):
        (folder / f"part{number}.ts").write_bytes(part)
        lines += [f"#EXTINF:{seconds:.3f},", f"part{number}.ts"]
    playlist = "\n".join([*lines, "#EXT-X-ENDLIST", ""])
    with served(folder, "list.m3u8", playlist.encode()) as address:
        yield address


def rtp_of_h264(data, rate=30):
    """Return the RTP packets of each picture of an H.264 stream, and its media description."""
    pictures = []
    numbers = count()
    for k, units in enumerate(nal_units(data)):
        payloads = [payload for unit in units for payload in _payloads(unit)]
        ends = [False] * (len(payloads) - 1) + [True]
        parts = zip(ends, payloads, strict=True)
        pictures.append(
            [_rtp(96, next(numbers), 90000 // rate * k, end, payload) for end, payload in parts]
        )
    description = (
        "m=video 0 RTP/AVP 96\r\na=rtpmap:96 H264/90000\r\na=fmtp:96 packetization-mode=1\r\n"
    )
    return pictures, description + "a=control:track0\r\n"


def _payloads(unit):
    """Return a NAL unit, in fragments if it is too large for a packet (RFC 6184, 5.6 and 5.8)."""
    if len(unit) <= DATAGRAM:
        return [unit]
    parts = [unit[at : at + DATAGRAM] for at in range(1, len(unit), DATAGRAM)]
    flags = [0x80, *[0] * (len(parts) - 2), 0x40]  # of the first and the last one
    heads = [bytes([unit[0] & 0xE0 | 28, flag | unit[0] & 31]) for flag in flags]
    return [head + part for head, part in zip(heads, parts, strict=True)]


def _rtp(kind, number, time, ends, payload):
    """Return an RTP packet; ``ends``: it is the last one of a picture."""
    return struct.pack(">BBHII", 0x80, (0x80 if ends else 0) | kind, number, time, 1) + payload


@contextmanager
def rtsp_server(packets, media):
    """Serve RTP packets by RTSP, once to each client; gives the address.

    :param media: their description in SDP.
    """
    sdp = f"v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=test\r\nt=0 0\r\n{media}"
    replies = {
        "OPTIONS": "Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN\r\n",
        "DESCRIBE": f"Content-Type: application/sdp\r\nContent-Length: {len(sdp)}\r\n",
        "SETUP": "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\nSession: 1\r\n",
        "PLAY": "Session: 1\r\nRange: npt=0.000-\r\n",
        "TEARDOWN": "Session: 1\r\n",
    }

    class Handler(StreamRequestHandler):
        def handle(self):
            while line := self.rfile.readline():
                method = line.split()[0].decode()
                head = {}
                while (line := self.rfile.readline().strip()) != b"":
                    name, _, value = line.decode().partition(":")
                    head[name.lower()] = value.strip()
                reply = f"RTSP/1.0 200 OK\r\nCSeq: {head['cseq']}\r\n{replies[method]}\r\n"
                self.wfile.write((reply + (sdp if method == "DESCRIBE" else "")).encode())
                if method == "PLAY":
                    with suppress(OSError):  # the client left
                        self.play()
                    return

        def play(self):
            for rtp in packets:
                self.wfile.write(struct.pack(">cBH", b"$", 0, len(rtp)) + rtp)

    with ThreadingTCPServer(("127.0.0.1", 0), Handler) as server, _running(server) as port:
        yield f"rtsp://127.0.0.1:{port}/live"
