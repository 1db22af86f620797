# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of cameras, from files and answers as Video4Linux gives them."""

import errno
import struct
import sys

import pytest
from scope.scope_addon.job import live_cameras
from scope.scope_addon.job.live_cameras import LONGEST_NAME, camera_source, list_cameras
from scope.scope_addon.live import video4linux

SIZES = {b"MJPG": [(640, 480), (1920, 1080)], b"YUYV": [(640, 480)]}


def ioctl(node, request, answer):
    """A camera with two formats, whose second node carries metadata; see linux/videodev2.h. An old
    driver does not say what each node can do.
    """
    number = request & 0xFF
    assert len(answer) == (request >> 16) & 0x3FFF  # the size that the request's number contains
    if number == 0:
        with open(f"/proc/self/fd/{node}", "rb") as file:
            content = file.read()
        of_this = {b"pictures": 1, b"metadata": 0x00800000, b"old": 0}[content]
        of_all = 1 if content == b"old" else 1 << 31 | 0x00800000 | 1
        struct.pack_into("II", answer, 16 + 32 + 32 + 4, of_all, of_this)
    elif number == 2:
        (index,) = struct.unpack_from("I", answer)
        if index >= len(SIZES):
            raise OSError(errno.EINVAL, "no more")
        answer[44:48] = list(SIZES)[index]
    else:
        index, code = struct.unpack_from("II", answer)
        sizes = SIZES[code.to_bytes(4, "little")]
        if index >= len(sizes):
            raise OSError(errno.EINVAL, "no more")
        struct.pack_into("III", answer, 8, 1, *sizes[index])


@pytest.fixture
def node(tmp_path, monkeypatch):
    """Adds a camera to those of the system."""
    if not sys.platform.startswith("linux"):
        pytest.skip("Video4Linux")
    monkeypatch.setattr(live_cameras, "NAMES", tmp_path / "sys")
    monkeypatch.setattr(live_cameras, "DEVICES", tmp_path / "dev")
    monkeypatch.setattr(video4linux, "_ask", ioctl)

    def node(number, name, content):
        (tmp_path / "sys" / f"video{number}").mkdir(parents=True)
        (tmp_path / "sys" / f"video{number}" / "name").write_bytes(name)
        if content is not None:
            (tmp_path / "dev").mkdir(exist_ok=True)
            (tmp_path / "dev" / f"video{number}").write_bytes(content)

    return node


def test_cameras_are_listed_with_names_and_largest_sizes(node):
    assert list_cameras() == []
    node(10, b"Second\n", b"old")
    node(0, b"USB Camera\n", b"pictures")
    node(1, b"USB Camera\n", b"metadata")
    labels = [camera.label for camera in list_cameras()]
    assert labels == [
        f"{n}: {name} (MJPG 1920×1080, YUYV 640×480)"
        for n, name in ((0, "USB Camera"), (10, "Second"))
    ]


def test_a_camera_that_cannot_be_opened_is_listed_without_sizes(node):
    node(0, b"Busy", None)
    assert [camera.label for camera in list_cameras()] == ["0: Busy"]


def test_hostile_names_are_harmless(node):
    node(0, b"\x1b[2J\xe2\x80\xaeevil\n\x00name" + b"x" * 500, None)
    node(1, b"\xff\xfe", None)
    node(2, b"\n", None)
    first, second, third = list_cameras()
    assert first.name.startswith("[2Jevilname")
    assert len(first.name) == LONGEST_NAME
    assert (second.name, third.name) == ("\ufffd\ufffd", "camera")
    assert camera_source(first.label) == "0"


@pytest.mark.parametrize(
    ("text", "source"),
    [
        (" 2 ", "2"),
        ("1: USB Camera: front (MJPG 1920×1080)", "1"),
        ("/dev/video3", "/dev/video3"),
        ("1234", None),
        ("0x", None),
        ("/dev/sda", None),
        ("", None),
    ],
)
def test_the_source_of_a_label_is_its_number(text, source):
    assert camera_source(text) == source
