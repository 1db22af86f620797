# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses as lines of JSON on a TCP socket, for several clients.

Each client first gets one line that describes the body, then one line per pose. A client that reads
too slowly misses poses; it never delays the capture or other clients. At the end, clients get what
is queued for them, but the end does not wait for those that do not read it.
"""

from __future__ import annotations

import json
import socket
import threading
import time
from collections import deque
from contextlib import suppress
from typing import Any

from ...solver import Body
from ..errors import OutputError
from .pose import LivePose, values

VERSION = 1
MAX_CLIENTS = 16
_QUEUED_LINES = 2  # per client and person; older ones are dropped
# some eight poses: what the system queues for a slow client is delay as well
_SEND_BUFFER_BYTES = 32768
_SEND_TIMEOUT_S = 10.0  # after which a client that reads nothing is disconnected
# The end waits so long for all clients together: with the time for a source, less than a second.
_CLOSING_S = 0.4


class JsonServer:
    """A context that serves poses.

    :param address: to listen on.
    :param port: 0: any free one, see `port`.
    :param people: of whom poses are sent, one after another.
    :raises OutputError: the port is in use, or the address is not one of this computer's.
    """

    def __init__(self, body: Body, address: str, port: int, people: int = 1) -> None:
        self._header = line(description(body))
        self._people = people
        self._clients: list[_Client] = []
        self._lock = threading.Lock()
        self._is_over = False
        try:
            family = socket.AF_INET6 if ":" in address else socket.AF_INET
            self._socket = socket.create_server((address, port), family=family)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise OutputError(
                f"cannot listen on {address} port {port} ({reason}); choose another --json-port or "
                "--listen address"
            ) from error
        self.port: int = self._socket.getsockname()[1]
        self._thread = threading.Thread(target=self._accept, name="scope-live-json", daemon=True)
        self._thread.start()

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Queue a pose for every client."""
        with self._lock:
            self._clients = [client for client in self._clients if not client.is_gone]
            clients = list(self._clients)
        if clients:
            data = line(values(pose, latency_ms))
            for client in clients:
                client.queue(data)

    def __enter__(self) -> JsonServer:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):  # wakes the accepting thread, which closing alone does not
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        with self._lock:
            self._is_over = True
            clients = list(self._clients)
        for client in clients:
            client.finish()
        end_s = time.monotonic() + _CLOSING_S
        for client in clients:
            client.close(end_s - time.monotonic())

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            with self._lock:
                self._clients = [client for client in self._clients if not client.is_gone]
                if self._is_over or len(self._clients) >= MAX_CLIENTS:
                    connection.close()
                    continue
                self._clients.append(
                    _Client(connection, self._header, _QUEUED_LINES * self._people)
                )


class _Client:
    """One connection, with a thread of its own."""

    def __init__(self, connection: socket.socket, header: bytes, queued_lines: int) -> None:
        self._connection = connection
        self._header = header
        self._lines: deque[bytes] = deque(maxlen=queued_lines)
        self._changed = threading.Condition()
        self._is_finishing = self.is_gone = False
        with suppress(OSError):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
            connection.settimeout(_SEND_TIMEOUT_S)
        self._thread = threading.Thread(target=self._run, name="scope-live-client", daemon=True)
        self._thread.start()

    def queue(self, data: bytes) -> None:
        """Queue a line; if there are too many, the oldest one is dropped."""
        with self._changed:
            self._lines.append(data)
            self._changed.notify()

    def finish(self) -> None:
        """Disconnect when the queued lines have been sent."""
        with self._changed:
            self._is_finishing = True
            self._changed.notify()

    def close(self, wait_s: float) -> None:
        """Wait until the client is disconnected, but not for long, and then disconnect it."""
        self._thread.join(max(wait_s, 0.0))
        if self._thread.is_alive():
            with suppress(OSError):  # wakes the thread, which closing alone does not
                self._connection.shutdown(socket.SHUT_RDWR)

    def _run(self) -> None:
        with self._connection, suppress(OSError):
            self._connection.sendall(self._header)
            while (data := self._next()) is not None:
                self._connection.sendall(data)
        self.is_gone = True

    def _next(self) -> bytes | None:
        """Wait for a line and return it; None after the last one."""
        with self._changed:
            self._changed.wait_for(lambda: self._lines or self._is_finishing)
            return self._lines.popleft() if self._lines else None


def line(values: dict[str, Any]) -> bytes:
    """Return values as one line."""
    return json.dumps(values, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def description(body: Body) -> dict[str, Any]:
    """Return what does not change: the joints and their tree."""
    return {
        "format": "scope live",
        "version": VERSION,
        "body": body.name,
        "joints": list(body.joint_names),
        "parents": [int(parent) for parent in body.parents],
        "axes": "right-handed, z up, metres; rotations are quaternions w, x, y, z relative to the "
        "parent joint",
    }
