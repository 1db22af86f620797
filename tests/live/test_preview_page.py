# SPDX-License-Identifier: GPL-3.0-or-later
"""The preview in a browser: the footage with the skeleton where the camera sees the joints, for
this computer alone.
"""

from __future__ import annotations

import re
import socket
import urllib.error
import urllib.request
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera, pinhole
from scope.scope_addon.live.preview_page import PreviewPage
from scope.scope_addon.live.smoothing import DELAY_S
from scope.scope_addon.live.source import Picture

from ..job.processes import wait_for
from .test_vmc import pose_of

CAMERA = Camera(pinhole(320, 240, 300.0), np.zeros(5), "of the test")


def read_picture(response):
    """Return the next picture (240, 320, 3) that a browser gets."""
    head = b""
    while not head.endswith(b"\r\n\r\n"):
        head += response.read(1)
    jpeg = response.read(int(re.search(rb"Content-Length: (\d+)", head)[1]))
    return cv2.cvtColor(cv2.imdecode(np.frombuffer(jpeg, np.uint8), 1), cv2.COLOR_BGR2RGB)


def first_picture(page, pose, pictures):
    """Return the first picture (240, 320, 3) that a browser gets."""
    page.begin(SimpleNamespace(sessions=[SimpleNamespace(camera=CAMERA)]), (320, 240))
    with urllib.request.urlopen(page.address + ".mjpeg", timeout=300) as response:
        assert "multipart/x-mixed-replace" in response.headers["Content-Type"]
        wait_for(lambda: page._viewers)  # until then, no picture is kept
        for picture in pictures:
            page.receive(picture)
        page.send(pose, 0.0)
        return read_picture(response)


@pytest.fixture
def pose(body):
    """Somebody 4 m in front of the camera, whose footage is grey."""
    pose = pose_of(body)
    cam = (pose.joints - pose.T_world_camera[:3, 3]) @ pose.T_world_camera[:3, :3]
    moved = np.array([0.0, 0.0, 4.0]) - cam.mean(axis=0)
    return replace(
        pose, joints=pose.joints + moved @ pose.T_world_camera[:3, :3].T, timestamp_s=2.0
    )


def shades(time_s, value):
    return Picture(0, time_s, time_s, np.full((240, 320, 3), value, np.uint8))


def test_other_computers_and_those_who_do_not_know_the_address_get_nothing(body):
    with PreviewPage(body) as page, PreviewPage(body) as other:
        assert page.address.rpartition("/")[2] != other.address.rpartition("/")[2]
        port = int(re.search(r":(\d+)/", page.address)[1])
        # Another address of this computer, on which a server for others would listen, too.
        with pytest.raises(OSError, match=r"refused|timed out|assign"):
            socket.create_connection(("127.0.0.2", port), timeout=5)


def test_the_page_shows_the_picture_of_the_pose_with_the_skeleton(body, pose):
    pictures = [shades(2.0 - 3 * DELAY_S, 40), shades(2.0 - DELAY_S, 90), shades(2.0, 160)]
    with PreviewPage(body) as page:
        with urllib.request.urlopen(page.address, timeout=300) as response:
            assert page.address.rpartition("/")[2] + ".mjpeg" in response.read().decode()
        image = first_picture(page, pose, pictures).astype(int)
    assert abs(np.median(image) - 90) < 6  # of the time that the pose belongs to
    joints = (pose.joints - pose.T_world_camera[:3, 3]) @ pose.T_world_camera[:3, :3]
    pixels = np.round(joints[:, :2] / joints[:, 2:] * 300.0 + [159.5, 119.5]).astype(int)
    drawn = np.abs(image - 90).max(axis=2) > 40
    assert all(drawn[y - 2 : y + 3, x - 2 : x + 3].any() for x, y in pixels)
    far = (
        np.min(
            [np.hypot(*(np.indices(drawn.shape)[::-1] - p[:, None, None])) for p in pixels], axis=0
        )
        > 60
    )
    assert not drawn[far].any()


def test_another_address_shows_nothing_and_nothing_is_kept_without_a_browser(body, pose):
    with PreviewPage(body) as page:
        base = page.address.rpartition("/")[0]
        assert base.startswith("http://127.0.0.1:")
        for path in ("", "index.html", "guess.mjpeg"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(f"{base}/{path}", timeout=300)
        page.receive(shades(0.0, 1))
        assert not page._pictures
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(page.address, timeout=300)
