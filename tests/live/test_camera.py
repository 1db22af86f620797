# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera that cannot be used, or no longer, says why; the errors are those that Linux gives."""

from __future__ import annotations

import errno
import os
import struct
import sys
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.errors import VideoError
from scope.scope_addon.live import camera
from scope.scope_addon.live.camera import CameraSource, device_problem
from scope.scope_addon.live.newest_frame import NewestFrame
from scope.scope_addon.live.source import Clock

from .fake_source import FakeClock

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="devices of Linux")
# of linux/videodev2.h
CAPTURE = 1
METADATA = 0x00800000
HAS_OWN_ANSWER = 1 << 31


def answering(of_all, of_this=0):
    """An ioctl that answers what a device can do."""

    def ioctl(node, request, answer):
        # VIDIOC_QUERYCAP and its size
        assert (request & 0xFFFF, len(answer)) == (0x5600, (request >> 16) & 0x3FFF)
        struct.pack_into("II", answer, 16 + 32 + 32 + 4, of_all, of_this)

    return ioctl


def failing(number):
    def fail(*_):
        raise OSError(number, os.strerror(number))

    return fail


@pytest.fixture
def device(tmp_path):
    path = tmp_path / "video0"
    path.write_bytes(b"")
    return path


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (
            errno.EACCES,
            "may not be used by this user; on most systems, cameras belong to the group 'video'",
        ),
        (errno.EPERM, "may not be used by this program, which runs without access to cameras"),
        (errno.EBUSY, "is used by another program; close that"),
        (errno.ENODEV, "is not plugged in any more"),
        (errno.ENXIO, "is not plugged in any more"),
        (errno.EMFILE, "cannot be opened (too many open files)"),
    ],
)
def test_why_a_device_cannot_be_opened_is_said(device, monkeypatch, number, said):
    monkeypatch.setattr(camera.os, "open", failing(number))
    assert device_problem(device) == said


@pytest.mark.skipif(not os.access("/dev/null", os.W_OK), reason="/dev/null cannot be opened")
def test_another_device_is_no_camera():
    source = CameraSource("/dev/null")
    with pytest.raises(
        VideoError, match="^camera /dev/null is not a camera; choose another device$"
    ):
        next(iter(source.pictures(Clock())))


BOTH = CAPTURE | METADATA | HAS_OWN_ANSWER


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ((BOTH, METADATA), "delivers no images, like the second device of many cameras; choose"),
        ((BOTH, CAPTURE), ""),
        ((CAPTURE,), ""),  # of a driver that does not tell its nodes apart
    ],
)
def test_the_node_of_a_camera_s_metadata_gives_no_pictures(device, monkeypatch, answer, said):
    monkeypatch.setattr("fcntl.ioctl", answering(*answer))
    assert device_problem(device).partition(" another")[0] == said


@pytest.fixture
def opened(device, monkeypatch):
    """Cameras that give a number of pictures each time they are opened, and what happens after
    these.
    """
    lives = []

    class Capture:
        def __init__(self, name):
            assert name == str(device)
            self.left, self.then = lives.pop(0)
            self.isOpened = lambda: True
            self.set = lambda *_: True
            self.get = lambda _: 30.0
            self.release = lambda: None

        def read(self):
            self.left -= 1
            if self.left >= 0:
                return True, np.full((4, 6, 3), (250, 100, 0), np.uint8)
            self.then()
            return False, None

    monkeypatch.setattr(
        camera, "cv2", SimpleNamespace(**vars(camera.cv2) | {"VideoCapture": Capture})
    )
    monkeypatch.setattr("fcntl.ioctl", answering(CAPTURE))
    return lives


def test_a_camera_that_is_unplugged_and_plugged_in_again_goes_on(device, opened):
    opened += [(3, device.unlink), (2, lambda: None)]
    said = []
    taken = []
    clock = FakeClock()

    def say(text):
        said.append(text)
        if len(said) == 2:
            clock.stopped.set()
        else:
            device.write_bytes(b"")

    with NewestFrame(CameraSource(str(device)), clock, 0.01, say, taken.append) as reader:
        reader._thread.join(300)
    name = f"camera {device}"
    assert said == [
        f"{name} is not plugged in any more; connecting again in 0.01 s",
        f"{name} gives no more frames; check that it is plugged in; connecting again in 0.01 s",
    ]
    assert [picture.index for picture in taken] == [0, 1, 2, 3, 4]
    assert taken[0].image_rgb[0, 0].tolist() == [0, 100, 250]


def test_a_camera_that_gives_nothing_from_the_start_may_be_in_use(device, opened):
    opened.append((0, lambda: None))
    with pytest.raises(VideoError, match="gives no frames; check that no other program uses it"):
        list(islice(CameraSource(str(device)).pictures(Clock()), 1))
