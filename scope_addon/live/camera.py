# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera of this computer, and why it gives no pictures."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import cv2

from ..arrays import Uint8Array
from ..errors import VideoError
from ..notices import Notice
from . import system_cameras
from .source import DEFAULT_FPS, Clock, Picture, Source
from .video4linux import delivers_images

CAMERA_SIZE = (1280, 720)
_OPEN_ERRORS = {
    errno.EACCES: "may not be used by this user; on most systems, cameras belong to the group "
    "'video'",
    errno.EPERM: "may not be used by this program, which runs without access to cameras",
    errno.EBUSY: "is used by another program; close that",
    errno.ENODEV: "is not plugged in any more",
    errno.ENXIO: "is not plugged in any more",
}


class CameraSource(Source):
    """A camera of this computer, by number or device."""

    def __init__(self, device: int | str) -> None:
        """Check that the device exists, where that can be seen from its name.

        :raises VideoError: it does not.
        """
        self._device = device
        self.name = f"camera {device}"
        self._path = Path(f"/dev/video{device}" if isinstance(device, int) else device)
        self.warnings: list[Notice] = []
        self._require_device()

    def pictures(self, clock: Clock) -> Iterator[Picture]:
        """See `Source`.

        :raises VideoError: it cannot be opened, or gives no more frames.
        """
        if isinstance(self._device, int) and system_cameras.camera_names(sys.platform):
            yield from self._system_pictures(clock)
            return
        capture = self._open()
        try:
            index = 0
            while True:
                ok, bgr = capture.read()
                now_s = clock.now()
                if not ok or bgr is None:
                    raise VideoError(
                        f"{self.name} {self._reason_without_images(has_begun=index > 0)}"
                    )
                yield Picture(
                    index,
                    now_s,
                    now_s,
                    cast(Uint8Array, cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)),
                )
                index += 1
        finally:
            capture.release()

    def _system_pictures(self, clock: Clock) -> Iterator[Picture]:
        """Yield the pictures of a camera of Windows or macOS.

        :raises VideoError: it cannot be opened, or gives no more frames.
        """
        assert isinstance(self._device, int)
        container = system_cameras.open_camera(self._device, CAMERA_SIZE, sys.platform)
        index = -1
        for index, image_rgb in enumerate(system_cameras.pictures(container, clock)):
            now_s = clock.now()
            yield Picture(index, now_s, now_s, image_rgb)
        raise VideoError(f"{self.name} {self._reason_without_images(has_begun=index >= 0)}")

    def _require_device(self) -> None:
        if sys.platform.startswith("linux") and not self._path.exists():
            found = sorted(str(p) for p in Path("/dev").glob("video*"))
            advice = (
                f"choose one of {', '.join(found)}"
                if found
                else "connect a camera, or choose a stream or a file"
            )
            raise VideoError(f"{self.name} does not exist; {advice}")

    def _open(self) -> Any:
        if sys.platform.startswith("linux") and (problem := self._problem()):
            raise VideoError(f"{self.name} {problem}")
        capture = cv2.VideoCapture(self._device)
        if not capture.isOpened():
            raise VideoError(
                f"{self.name} cannot be opened; check that it is plugged in, that no other program "
                "uses it, and that this one may use cameras"
            )
        # uncompressed, USB carries 10 frames/s
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, CAMERA_SIZE[0])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, CAMERA_SIZE[1])
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        rate = capture.get(cv2.CAP_PROP_FPS)
        self.fps = Fraction(round(rate)) if 1 <= rate <= 240 else DEFAULT_FPS
        return capture

    def _problem(self) -> str:
        return device_problem(self._path) if self._path.exists() else _OPEN_ERRORS[errno.ENODEV]

    def _reason_without_images(self, *, has_begun: bool) -> str:
        """Return the end of a sentence on a camera that gives no picture.

        :param has_begun: whether it gave some before.
        """
        if sys.platform.startswith("linux") and (problem := self._problem()):
            return problem
        if has_begun:
            return "gives no more frames; check that it is plugged in"
        return "gives no frames; check that no other program uses it"


def device_problem(path: Path) -> str:
    """Return why a device of Linux cannot be used as a camera, as the end of a sentence; empty if
    it can. This does not switch it on.
    """
    try:
        node = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    except OSError as error:
        return _OPEN_ERRORS.get(
            error.errno or 0, f"cannot be opened ({(error.strerror or 'unknown').lower()})"
        )
    try:
        gives = delivers_images(node)
    except OSError as error:
        gone = error.errno in (errno.ENODEV, errno.ENXIO, errno.EIO)
        return _OPEN_ERRORS[errno.ENODEV] if gone else "is not a camera; choose another device"
    finally:
        os.close(node)
    if gives:
        return ""
    return "delivers no images, like the second device of many cameras; choose another one"
