# SPDX-License-Identifier: GPL-3.0-or-later
"""A network camera: JPEG pictures over HTTP, each of which replaces the last one."""

import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2


@contextmanager
def mjpeg_server(pictures, interval_s=0.03, rounds=1, left=None):
    """Serve RGB pictures to every client, ``rounds`` times; then the connection ends.

    :param left: an event to set when a client has left.
    :return: context manager that gives the address.
    """
    jpegs = [
        cv2.imencode(".jpg", cv2.cvtColor(p, cv2.COLOR_RGB2BGR))[1].tobytes() for p in pictures
    ]
    stopped = threading.Event()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
            self.end_headers()
            try:
                for jpeg in jpegs * rounds:
                    head = (
                        f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: "
                        f"{len(jpeg)}\r\n\r\n"
                    )
                    self.wfile.write(head.encode() + jpeg + b"\r\n")
                    if stopped.wait(interval_s):
                        return
            except OSError:
                if left is not None:
                    left.set()

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/video"
    finally:
        stopped.set()
        server.shutdown()
        thread.join()
        server.server_close()
