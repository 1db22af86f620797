# SPDX-License-Identifier: GPL-3.0-or-later
"""A network camera on this computer: JPEG pictures at 30 per second, there and back again and
again.

Usage: ``mjpeg_camera.py FOLDER PORT CLIENTS``. The file CLIENTS is there once clients can come. A
line is added to it when one has come, and when one has left: "came" or "left", and the time
(seconds of the system's monotonic clock).
"""

from __future__ import annotations

import fcntl
import itertools
import socket
import struct
import sys
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

RATE = 30.0
# of Linux
_SET_FLAGS = 0x8914
_UP_AND_RUNNING = 0x41


def enable_loopback() -> None:
    """Switch on the loopback interface, which is off in the new network of a part."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, _SET_FLAGS, struct.pack("16sh14x", b"lo", _UP_AND_RUNNING))


def main(folder: str, port: str, clients: str) -> None:
    """Serve until the process is ended."""

    def note(what: str) -> None:
        with open(clients, "a") as file:
            file.write(f"{what} {time.monotonic()}\n")

    pictures = [path.read_bytes() for path in sorted(Path(folder).glob("*.jpg"))]
    pictures += pictures[-2:0:-1]  # there and back, so that nothing jumps where a round ends

    class Camera(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            """Send pictures until the client leaves."""
            self.send_response(200)
            self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
            self.end_headers()
            note("came")
            began = time.monotonic()
            try:
                for index, picture in enumerate(itertools.cycle(pictures)):
                    head = (
                        f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: "
                        f"{len(picture)}\r\n\r\n"
                    )
                    self.wfile.write(head.encode() + picture + b"\r\n")
                    time.sleep(max(0.0, began + index / RATE - time.monotonic()))
            except OSError:
                note("left")

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    enable_loopback()
    server = ThreadingHTTPServer(("127.0.0.1", int(port)), Camera)
    Path(clients).touch()
    server.serve_forever()


if __name__ == "__main__":
    main(*sys.argv[1:])
