# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras of Windows and macOS, listed and opened by FFmpeg, so that a camera's number is its place
in the list.

OpenCV opens cameras by numbers of its own there, whose order no list tells. Not tried with cameras
of these systems: documentation and source text of FFmpeg's dshow and avfoundation are what this
follows.

A camera's modes come from FFmpeg's log, which is switched on meanwhile: in a process of its own,
never in Blender's. dshow loads the camera's driver for it, and runs nothing. avfoundation opens the
device, for which macOS asks the user, refuses the size that it is asked for, and closes the device
before any picture is taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from ...errors import VideoError
from ..clock import Clock
from .camera_modes import Mode, nearest_mode, parse_modes

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.device import DeviceInfo

FORMATS = {"win32": "dshow", "darwin": "avfoundation"}  # of FFmpeg, by `sys.platform`
# What a camera is asked for beside the size: some refuse a rate that they do not have, and others
# want one to be given.
_REQUESTED_MODES: tuple[dict[str, str], ...] = ({"framerate": "30"}, {})
# What makes each of them log a camera's modes, and refuse to open it. No camera has so small a
# picture.
_LISTING = {"dshow": {"list_options": "true"}, "avfoundation": {"video_size": "1x1"}}
# for the next picture, and without one, after which a camera counts as gone
_WAITING_S = 0.002
_GONE_S = 5.0


def camera_names(platform: str) -> list[str]:
    """Return the names of the cameras, in FFmpeg's order; none where it does not list them, as on
    Linux.
    """
    return [_name(device) for device in _devices(platform)]


def open_camera(number: int, size: tuple[int, int], platform: str) -> InputContainer:
    """Open a camera of the list.

    :param size: width and height that it is asked for, pixels; it gives another size if it does not
        have this one.
    :raises VideoError: it does not exist, or cannot be opened.
    """
    import av

    device = _device(number, platform)
    problem = ""
    for wanted in _wanted(device, size, platform):
        try:
            return av.open(
                _file(device, platform), format=FORMATS[platform], options=wanted, mode="r"
            )
        except (av.error.FFmpegError, OSError, ValueError) as error:
            problem = str(getattr(error, "strerror", None) or error).lower()
    raise VideoError(
        f"camera {number} ({_name(device)}) cannot be opened ({problem}); check that it is plugged"
        " in, that no other program uses it, and that this one may use cameras"
    )


def camera_with_modes(number: int, platform: str) -> tuple[str, list[Mode]]:
    """Return the name and the modes of a camera of the list; no modes if FFmpeg does not tell them.

    :raises VideoError: it does not exist.
    """
    device = _device(number, platform)
    return _name(device), _modes(device, platform)


def pictures(container: InputContainer, clock: Clock) -> Iterator[NDArray[np.uint8]]:
    """Yield the (H, W, 3) RGB pictures of an open camera as they come, until it gives no more."""
    import av

    with container as opened:
        seen_s = clock.now()
        is_open = True
        while is_open and clock.now() - seen_s < _GONE_S:
            try:
                for frame in opened.decode(video=0):
                    seen_s = clock.now()
                    yield cast(NDArray[np.uint8], frame.to_ndarray(format="rgb24"))
                is_open = False
            except av.error.BlockingIOError:  # avfoundation does not wait for the next picture
                clock.sleep(_WAITING_S)
            except av.error.FFmpegError:
                is_open = False


def _wanted(device: DeviceInfo, size: tuple[int, int], platform: str) -> Iterator[dict[str, str]]:
    """Yield what a camera is asked for, from the best on: the size, then what is nearest to it,
    then anything.
    """
    for wish in _REQUESTED_MODES:
        yield {"video_size": f"{size[0]}x{size[1]}"} | wish
    if (mode := nearest_mode(_modes(device, platform), size)) is not None:
        width, height = mode.nearest_size(size)
        yield {"video_size": f"{width}x{height}", "framerate": f"{mode.fps:.6f}"}
        # of drivers that report infinite rates, FFmpeg accepts none
        yield {"video_size": f"{width}x{height}"}
    yield from _REQUESTED_MODES


def _modes(device: DeviceInfo, platform: str) -> list[Mode]:
    import av

    kind = FORMATS[platform]
    level = av.logging.get_level()
    skips = av.logging.get_skip_repeated()
    av.logging.set_level(av.logging.INFO)
    # the note of a repetition has no end of line, and spoils the next one
    av.logging.set_skip_repeated(False)
    try:
        with av.logging.Capture() as log, suppress(av.error.FFmpegError, OSError, ValueError):
            av.open(_file(device, platform), format=kind, options=_LISTING[kind], mode="r").close()
    finally:
        av.logging.set_level(level)
        av.logging.set_skip_repeated(skips)
    # dshow logs a line in pieces
    return parse_modes("".join(message for _, _, message in log), kind)


def _file(device: DeviceInfo, platform: str) -> str:
    return f"video={device.name}" if FORMATS[platform] == "dshow" else device.name


def _device(number: int, platform: str) -> DeviceInfo:
    """Return a camera of the list.

    :raises VideoError: it does not exist.
    """
    devices = _devices(platform)
    if number < len(devices):
        return devices[number]
    names = ", ".join(f"{k}: {_name(device)}" for k, device in enumerate(devices))
    raise VideoError(
        f"camera {number} does not exist; "
        + (
            f"choose one of {names}"
            if devices
            else "connect a camera, or choose a stream or a file"
        )
    )


def _name(device: DeviceInfo) -> str:
    return "".join(c for c in device.description or device.name if c.isprintable())


def _devices(platform: str) -> list[DeviceInfo]:
    """Return the cameras that FFmpeg lists, without microphones and screens."""
    import av

    if platform not in FORMATS:
        return []
    found: list[DeviceInfo] = []
    with suppress(av.error.FFmpegError, OSError, ValueError):
        found = av.enumerate_input_devices(FORMATS[platform])
    # dshow of older versions does not say what a device gives.
    cameras = [
        device for device in found if not device.media_types or "video" in device.media_types
    ]
    return [device for device in cameras if not device.description.startswith("Capture screen")]
