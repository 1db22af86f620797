# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras of Windows and macOS, as FFmpeg would list and open them: there are none here, so that it is replaced."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace

import av
import numpy as np
import pytest
from scope.scope_addon.errors import VideoError
from scope.scope_addon.job.live.cameras import camera_source, list_cameras
from scope.scope_addon.live import system_cameras
from scope.scope_addon.live.clock import Clock
from scope.scope_addon.live.sources import open_source

BLUE = np.full((48, 64, 3), (10, 20, 240), np.uint8)


def device(name, description, *media):
    return SimpleNamespace(name=name, description=description, media_types=list(media), is_default=False)


SYSTEMS = {
    "win32": [
        device("@device_cm_1", "Microphone Array", "audio"),
        device("@device_pnp_1", "Integrated Camera", "video"),
        device("@device_pnp_2", "USB\x1b[2J Camera", "video"),
    ],
    "darwin": [
        device("0", "FaceTime HD Camera", "video"),
        device("1", "USB\x1b[2J Camera", "video"),
        device("2", "Capture screen 0", "video"),
        device("0", "MacBook Microphone", "audio"),
    ],
}
OPENED = {"win32": ("dshow", "video=@device_pnp_2"), "darwin": ("avfoundation", "1")}


@pytest.fixture(params=sorted(SYSTEMS))
def system(request, monkeypatch):
    """A system whose cameras refuse rates that they do not have."""
    asked = []

    def open_device(file, *, format, options, mode):
        asked.append((format, file, options))
        if "framerate" in options:
            raise OSError("Selected framerate is not supported")
        pieces = [1, 1]

        def decode(video):
            for _ in range(pieces.pop()):
                yield av.VideoFrame.from_ndarray(BLUE, format="rgb24")
            if pieces:
                raise av.error.BlockingIOError(11, "Resource temporarily unavailable")  # there is no picture yet

        return nullcontext(SimpleNamespace(decode=decode))

    monkeypatch.setattr("sys.platform", request.param)
    listed = {OPENED[request.param][0]: SYSTEMS[request.param]}
    monkeypatch.setattr(av, "enumerate_input_devices", listed.__getitem__)
    monkeypatch.setattr(av, "open", open_device)
    return SimpleNamespace(name=request.param, asked=asked)


def test_cameras_are_listed_without_microphones_and_screens(system):
    labels = [camera.label for camera in list_cameras()]
    assert labels[1:] == ["1: USB[2J Camera"]
    assert labels[0] in ("0: Integrated Camera", "0: FaceTime HD Camera")
    assert camera_source(labels[1]) == "1"


def test_the_camera_of_the_list_is_opened_in_720p_and_its_pictures_are_given(system):
    taken = []
    with pytest.raises(VideoError, match="camera 1 gives no more frames; check that it is plugged in"):
        taken.extend(open_source("1").pictures(Clock()))
    assert [(k, file) for k, file, _ in system.asked] == [OPENED[system.name]] * 2
    assert [options for _, _, options in system.asked] == [
        {"video_size": "1280x720", "framerate": "30"},
        {"video_size": "1280x720"},
    ]
    assert [picture.index for picture in taken] == [0, 1]
    assert np.array_equal(taken[0].image_rgb, BLUE)


def test_a_camera_that_is_not_there_is_said_with_those_that_are(system):
    with pytest.raises(VideoError, match="camera 7 does not exist; choose one of 0: .*, 1: USB"):
        next(iter(open_source("7").pictures(Clock())))


def test_a_camera_that_cannot_be_opened_is_said_by_its_name(system, monkeypatch):
    def refuse(*_, **__):
        raise OSError("Input/output error")

    monkeypatch.setattr(av, "open", refuse)
    with pytest.raises(VideoError, match=r"camera 0 \(.* Camera\) cannot be opened \(input/output error\); check"):
        next(iter(open_source("0").pictures(Clock())))


def test_a_system_that_lists_nothing_has_no_cameras(monkeypatch):
    def fail(_):
        raise ValueError("no such input format")

    monkeypatch.setattr(av, "enumerate_input_devices", fail)
    assert system_cameras.camera_names("win32") == []
    assert system_cameras.camera_names("linux") == []


@pytest.mark.parametrize("platform", sorted(SYSTEMS))
def test_where_nothing_is_listed_opencv_opens_the_number(platform, monkeypatch):
    monkeypatch.setattr("sys.platform", platform)
    monkeypatch.setattr(av, "enumerate_input_devices", lambda _: [])
    with pytest.raises(VideoError, match="camera 7 cannot be opened; check that it is plugged in"):
        next(iter(open_source("7").pictures(Clock())))
