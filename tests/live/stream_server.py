# SPDX-License-Identifier: GPL-3.0-or-later
"""Streams as servers give them: MPEG transport streams in pieces, and fragmented .mp4 from the middle on."""

import io
from contextlib import contextmanager
from fractions import Fraction
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import av

FRAGMENTED = {"movflags": "frag_every_frame+empty_moov+default_base_moof"}


@contextmanager
def served(folder, name, data):
    """Serve bytes over HTTP; gives the address."""
    (folder / name).write_bytes(data)

    class Handler(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=str(folder))) as server:
        server.daemon_threads = True
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/{name}"
        finally:
            server.shutdown()
            thread.join()


def encoded(images, codec="mpeg2video", kind="mpegts", group=10, begins_s=0.0, rate=30):
    """Return RGB images as a stream whose key frames are ``group`` frames apart."""
    target = io.BytesIO()
    with av.open(target, "w", format=kind, options=FRAGMENTED if kind == "mp4" else {}) as container:
        stream = container.add_stream(codec, rate=rate)
        stream.height, stream.width = images[0].shape[:2]
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.gop_size, stream.max_b_frames = group, 0
        for k, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.time_base, frame.pts = Fraction(1, rate), round(begins_s * rate) + k
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return target.getvalue()


def without_first(data, count, kind="mp4"):
    """Return a stream as somebody gets it who comes too late for its first packets."""
    target = io.BytesIO()
    with av.open(io.BytesIO(data)) as source, av.open(target, "w", format=kind, options=FRAGMENTED) as container:
        stream = container.add_stream_from_template(source.streams.video[0])
        for k, packet in enumerate(source.demux(video=0)):
            if packet.dts is not None and k >= count:
                packet.stream = stream
                container.mux(packet)
    return target.getvalue()
