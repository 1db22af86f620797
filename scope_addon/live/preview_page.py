# SPDX-License-Identifier: GPL-3.0-or-later
"""The footage of a live capture with the skeletons over it, as a page that a browser on this
computer shows.

The installed OpenCV has no windows. The page is served to this computer alone, under an address
that cannot be guessed, because it shows what a camera sees. Pictures are drawn and encoded in
threads of their own, the newest ones only, and only while a browser asks for them; each is the one
to which its poses belong, so that they coincide. At the end, the newest one is still shown:
browsers wait for what follows a picture before they show it.
"""

from __future__ import annotations

import secrets
import threading
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...solver import Body
from ..capture.camera.intrinsics import Camera, scaled_intrinsics
from ..errors import OutputError
from ..footage_view import scaled_size
from .people import LivePeople
from .pose import LivePose, Presence
from .session import LiveSession
from .smoothing import DELAY_S
from .source import Picture

LONGER_SIDE = 960  # pixels of what is shown
INTERVAL_S = 0.05  # between two pictures
_KEPT_S = 0.5  # for which pictures wait for their poses; a pose that is older has none
_MAX_KEPT = 12  # pictures; at 720p, 33 MB
_QUALITY = 80  # of the JPEG pictures
_CLOSING_S = 0.4  # for which the end waits for browsers
_POLLING_INTERVAL_S = 0.1  # in which the server sees that it is to end
_LEFT = (255, 140, 40)
_RIGHT = (40, 150, 255)
_MIDDLE = (235, 235, 235)
_JOINT = (255, 255, 255)
_PAGE = (
    '<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>Scope live</title>'
    '<body style="margin:0;background:#1d1d1d"><img src="{token}.mjpeg" alt="Live capture"'
    ' style="display:block;margin:auto;max-width:100%;max-height:100vh"></body></html>'
)
_BOUNDARY = "picture"


class PreviewPage:
    """A context that serves the page; ``address`` is its URL.

    :raises OutputError: the page cannot be served.
    """

    def __init__(self, body: Body) -> None:
        self._bones = [
            (k, int(p), _color(body.joint_names[k])) for k, p in enumerate(body.parents) if p >= 0
        ]
        self._session: LiveSession | None = None
        self._pictures: deque[Picture] = deque(maxlen=_MAX_KEPT)
        self._poses: dict[int, LivePose] = {}  # the newest of each person
        self._viewers = 0
        self._is_over = threading.Event()
        self._changed = threading.Condition()
        token = secrets.token_urlsafe(9)
        try:
            self._server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(self, token))
        except OSError as error:
            raise OutputError(
                f"the preview cannot be served on this computer ({error}); leave out --preview"
            ) from error
        self._server.daemon_threads = True
        self.address = f"http://127.0.0.1:{self._server.server_port}/{token}"
        self._thread = threading.Thread(
            target=self._server.serve_forever,
            args=(_POLLING_INTERVAL_S,),
            name="scope-live-preview",
            daemon=True,
        )
        self._thread.start()

    def __enter__(self) -> PreviewPage:
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        with self._changed:
            self._changed.notify_all()
        self._server.shutdown()
        self._server.server_close()
        with self._changed:
            self._changed.wait_for(lambda: not self._viewers, _CLOSING_S)

    def begin(self, people: LivePeople, size: tuple[int, int]) -> None:
        """Note by which session the camera is known."""
        self._session = people.sessions[0]

    def receive(self, picture: Picture) -> None:
        """Take a picture, from the thread that reads the source."""
        if self._viewers:
            self._pictures.append(picture)

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Take a pose."""
        with self._changed:
            self._poses[pose.person] = pose
            self._changed.notify_all()

    @contextmanager
    def viewed(self) -> Iterator[None]:
        """Keep pictures meanwhile, for a browser."""
        with self._changed:  # a browser may ask twice at the same time
            self._viewers += 1
        try:
            yield
        finally:
            with self._changed:
                self._viewers -= 1
                if not self._viewers:
                    self._pictures.clear()
                self._changed.notify_all()

    def pictures(self) -> Iterator[bytes]:
        """Yield JPEG pictures until the capture ends, the newest one last."""
        shown = -np.inf
        is_over = False
        while not is_over:
            is_over = self._is_over.wait(INTERVAL_S)
            with self._changed:
                while not self._is_over.is_set() and _newest_s(self._poses.values()) <= shown:
                    self._changed.wait(1.0)
                poses = list(self._poses.values())
            picture = self._picture_of(poses)
            newest = _newest_s(poses)
            if picture is not None and newest > shown:
                shown = newest
                yield self._drawn(picture, poses)

    def _picture_of(self, poses: Sequence[LivePose]) -> Picture | None:
        """Return the picture that was taken when the people had these poses."""
        time_s = _newest_s(poses) - DELAY_S
        near = [p for p in list(self._pictures) if abs(p.timestamp_s - time_s) < _KEPT_S]
        return min(near, key=lambda p: abs(p.timestamp_s - time_s), default=None)

    def _drawn(self, picture: Picture, poses: Sequence[LivePose]) -> bytes:
        """Return a picture with the skeletons of those who are seen, as JPEG."""
        height, width = picture.image_rgb.shape[:2]
        scale, size = scaled_size(width, height, min(LONGER_SIDE, max(width, height)))
        image: NDArray[Any] = np.ascontiguousarray(
            cv2.resize(picture.image_rgb, size, interpolation=cv2.INTER_AREA)
        )
        camera = None if self._session is None else self._session.camera
        for pose in poses:
            if camera is not None and pose.presence is not Presence.LOST:
                self._draw(image, pose, camera, scale)
        bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
        return bytes(cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1])

    def _draw(self, image: NDArray[Any], pose: LivePose, camera: Camera, scale: float) -> None:
        """Draw the bones of a pose into an image, in place."""
        R = pose.T_world_camera[:3, :3]
        t = pose.T_world_camera[:3, 3]
        joints = (pose.joints - t) @ R
        if joints[:, 2].min() <= 0.1:  # beside or behind the camera
            return
        intrinsics = scaled_intrinsics(camera.intrinsics, scale)
        nothing = np.zeros(3)
        pixels = cv2.projectPoints(joints, nothing, nothing, intrinsics, camera.dist)[0][:, 0]
        points = np.clip(np.round(pixels), -30000, 30000).astype(int).tolist()
        for k, parent, color in self._bones:
            cv2.line(image, points[parent], points[k], color, 3, cv2.LINE_AA)
        for point in points:
            cv2.circle(image, point, 3, _JOINT, -1, cv2.LINE_AA)


def _newest_s(poses: Iterable[LivePose]) -> float:
    """Return the time of the newest pose; -inf if there is none."""
    return max((pose.timestamp_s for pose in poses), default=-np.inf)


def _color(joint: str) -> tuple[int, int, int]:
    return _LEFT if joint.startswith("left") else _RIGHT if joint.startswith("right") else _MIDDLE


def _handler(page: PreviewPage, token: str) -> type[BaseHTTPRequestHandler]:
    """Return what answers a browser's requests."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            try:
                if self.path == f"/{token}":
                    self._send_page(_PAGE.format(token=token).encode())
                elif self.path == f"/{token}.mjpeg":
                    self._stream()
                else:
                    self.send_error(404)
            except OSError:  # the browser left
                pass

        def _send_page(self, content: bytes) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Referrer-Policy", "no-referrer")
            self.end_headers()
            self.wfile.write(content)

        def _stream(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={_BOUNDARY}")
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            with page.viewed():
                for jpeg in page.pictures():
                    head = (
                        f"--{_BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: "
                        f"{len(jpeg)}\r\n\r\n"
                    )
                    self.wfile.write(head.encode() + jpeg + b"\r\n")
                self.wfile.write(f"--{_BOUNDARY}--\r\n".encode())

        def log_message(self, *_: object) -> None:
            """Print nothing."""

    return Handler
