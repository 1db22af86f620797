# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras of Windows and macOS, as FFmpeg would list and open them: there are none here, so that it
is replaced.
"""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace

import av
import numpy as np
import pytest
from scope.scope_addon.errors import VideoError
from scope.scope_addon.job.live_cameras import camera_source, camera_with_formats, list_cameras
from scope.scope_addon.live import system_cameras
from scope.scope_addon.live.open_source import open_source
from scope.scope_addon.live.source import Clock

BLUE = np.full((48, 64, 3), (10, 20, 240), np.uint8)


def device(name, description, *media):
    return SimpleNamespace(
        name=name, description=description, media_types=list(media), is_default=False
    )


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
                # there is no picture yet
                raise av.error.BlockingIOError(11, "Resource temporarily unavailable")

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
    with pytest.raises(
        VideoError, match="camera 1 gives no more frames; check that it is plugged in"
    ):
        taken.extend(open_source("1").pictures(Clock()))
    assert [(k, file) for k, file, _ in system.asked] == [OPENED[system.name]] * 2
    assert [options for _, _, options in system.asked] == [
        {"video_size": "1280x720", "framerate": "30"},
        {"video_size": "1280x720"},
    ]
    assert [picture.index for picture in taken] == [0, 1]
    assert np.array_equal(taken[0].image_rgb, BLUE)


def test_a_camera_that_cannot_be_opened_is_said_by_its_name(system, monkeypatch):
    def refuse(*_, **__):
        raise OSError("Input/output error")

    monkeypatch.setattr(av, "open", refuse)
    with pytest.raises(
        VideoError,
        match=r"camera 0 \(.* Camera\) cannot be opened \(input/output "
        r"error\); check",
    ):
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


# What FFmpeg says of a camera, in the pieces in which dshow.c and avfoundation.m hand it to the
# log.
LOGS = {
    "win32": [
        "DirectShow video device options (from video "
        "devices)\n", ' Pin "Capture" (alternative pin name "0")\n',
        "  pixel_format=yuyv422", "  min s=640x480 fps=5 max s=640x480 "
                                  "fps=30", " (tv, bt470bg/bt709/unknown",
        ", topleft", ")", "\n", "  vcodec=mjpeg", "  min s=960x540 fps=5 max s=960x540 "
                                                  "fps=15", "\n",
        "  vcodec=mjpeg", "  min s=960x540 fps=5 max s=960x540 fps=15", "\n",
    ],
    "darwin": [
        "Selected video size (1x1) is not supported by the device.\n", "Supported modes:\n",
        *["  640x480@[15.000000 30.000000]fps\n"] * 3, "  960x540@[15.000000 15.000015]fps\n",
    ],
}  # fmt: skip
LEVELS = {"win32": av.logging.INFO, "darwin": av.logging.ERROR}
ASKED = {"win32": {"list_options": "true"}, "darwin": {"video_size": "1x1"}}
SHOWN = {"win32": ("yuyv422 640×480", "mjpeg 960×540"), "darwin": ("960×540", "640×480")}


@pytest.fixture
def telling(system, monkeypatch):
    """The same system, whose cameras have none of the sizes that they are asked for, and say which
    they have.
    """
    rate = "15.000000" if system.name == "win32" else "15.000015"

    def open_device(file, *, format, options, mode):
        system.asked.append((format, file, options))
        if options == ASKED[system.name]:
            for piece in LOGS[system.name]:
                av.logging.log(LEVELS[system.name], format, piece)
        if options != {"video_size": "960x540", "framerate": rate}:
            raise av.error.ExitError(5, "Immediate exit requested")
        return nullcontext(SimpleNamespace(decode=lambda video: iter([])))

    monkeypatch.setattr(av, "open", open_device)
    return system


def test_a_camera_tells_its_formats_through_ffmpegs_log(telling):
    camera = camera_with_formats("1")
    assert (camera.number, camera.name, camera.formats) == (1, "USB[2J Camera", SHOWN[telling.name])
    assert telling.asked == [(*OPENED[telling.name], ASKED[telling.name])]
    assert av.logging.get_level() is None  # as before
    assert av.logging.get_skip_repeated()
    with pytest.raises(VideoError, match="camera 7 does not exist; choose one of 0: "):
        camera_with_formats("7")


def test_a_camera_without_720p_is_opened_in_the_mode_nearest_to_it(telling):
    assert (
        list(
            system_cameras.pictures(
                system_cameras.open_camera(1, (1280, 720), telling.name), Clock()
            )
        )
        == []
    )
    sizes = [options.get("video_size") for _, _, options in telling.asked]
    assert sizes[:2] == ["1280x720"] * 2
    assert sizes[-1] == "960x540"
