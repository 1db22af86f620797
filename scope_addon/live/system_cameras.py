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

dshow logs the modes on request. avfoundation has no such request, but logs them when it refuses a
size. Names of drivers and pins are in the same text, which is therefore read as if it could be
anything.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from ..arrays import Uint8Array
from ..errors import VideoError
from .source import Clock

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
LONGEST_LOG = 1 << 18  # characters, beyond which nothing is read
MAX_MODES = 256
_SIDES = range(16, 16385)
_HIGHEST_FPS = 1000.0
_FPS = 30.0  # of the mode to ask for, as near as the camera has it
_NUMBER = r"([0-9.einf+]{1,20})"  # drivers that leave an interval out give infinite rates
_OF_DSHOW = re.compile(
    r"  (?:pixel_format=([a-z0-9_]{1,20})|vcodec=([a-z0-9_]{1,20})|unknown compression type "
    r"(0x[0-9A-F]{1,8}))"
    rf"  min s=(\d{{1,5}})x(\d{{1,5}}) fps={_NUMBER} max s=(\d{{1,5}})x(\d{{1,5}}) "
    rf"fps={_NUMBER}(?: ?\(|$)",
    re.ASCII,
)
_OF_AVFOUNDATION = re.compile(
    rf"  (\d{{1,5}})x(\d{{1,5}})@\[{_NUMBER} {_NUMBER}\]fps(?: "
    rf"\(repeated|$)",
    re.ASCII,
)


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


def pictures(container: InputContainer, clock: Clock) -> Iterator[Uint8Array]:
    """Yield the (H, W, 3) RGB pictures of an open camera as they come, until it gives no more."""
    import av

    with container as opened:
        seen_s = clock.now()
        is_open = True
        while is_open and clock.now() - seen_s < _GONE_S:
            try:
                for frame in opened.decode(video=0):
                    seen_s = clock.now()
                    yield cast(Uint8Array, frame.to_ndarray(format="rgb24"))
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


@dataclass(frozen=True)
class Mode:
    """Sizes in pixels and rates in frames/s from the least to the greatest, of one pixel format or
    codec.
    """

    format: str  # as FFmpeg names it; empty where it does not tell
    least: tuple[int, int]
    most: tuple[int, int]
    least_fps: float
    most_fps: float

    @property
    def fps(self) -> float:
        """The rate to ask for, frames/s; avfoundation, which does not tell the format, takes none
        but the greatest.
        """
        return min(max(_FPS, self.least_fps), self.most_fps) if self.format else self.most_fps

    def nearest_size(self, size: tuple[int, int]) -> tuple[int, int]:
        """Return the size of this mode that is nearest to another one."""
        width, height = (
            min(max(n, a), b) for n, a, b in zip(size, self.least, self.most, strict=True)
        )
        return width, height


def parse_modes(log: str, device_format: str) -> list[Mode]:
    """Return the modes in a log, without repetitions; lines that are none are left out.

    :param device_format: of FFmpeg, ``dshow`` or ``avfoundation``.
    """
    found: dict[Mode, None] = {}
    for line in log[:LONGEST_LOG].splitlines():
        mode = _dshow_mode(line) if device_format == "dshow" else _avfoundation_mode(line)
        if mode is not None and len(found) < MAX_MODES:
            found[mode] = None
    return list(found)


def described(modes: list[Mode]) -> list[str]:
    """Return each pixel format or codec with its largest size; where there are no formats, the
    sizes, largest first.
    """
    largest: dict[str, tuple[int, int]] = {}
    for mode in modes:
        largest[mode.format] = max(largest.get(mode.format, (0, 0)), mode.most, key=math.prod)
    if set(largest) == {""}:
        sizes = sorted({mode.most for mode in modes}, key=math.prod, reverse=True)
        return [f"{width}×{height}" for width, height in sizes]
    return [f"{name} {width}×{height}".strip() for name, (width, height) in largest.items()]


def nearest_mode(modes: list[Mode], size: tuple[int, int]) -> Mode | None:
    """Return the mode whose size is nearest to another one, and of these the one nearest to 30
    frames/s.
    """

    def distance(mode: Mode) -> tuple[float, float]:
        ratio = math.prod(mode.nearest_size(size)) / math.prod(size)
        return abs(math.log(ratio)), abs(math.log(mode.fps / _FPS))

    return min(modes, key=distance, default=None)


def _dshow_mode(line: str) -> Mode | None:
    if not (match := _OF_DSHOW.match(line)):
        return None
    pixels, codec, unknown, *numbers = match.groups()
    w0, h0, fps0, w1, h1, fps1 = numbers
    return _checked(
        Mode(
            pixels or codec or unknown,
            (int(w0), int(h0)),
            (int(w1), int(h1)),
            _rate(fps0),
            _rate(fps1),
        )
    )


def _avfoundation_mode(line: str) -> Mode | None:
    if not (match := _OF_AVFOUNDATION.match(line)):
        return None
    width, height, fps0, fps1 = match.groups()
    size = int(width), int(height)
    return _checked(Mode("", size, size, _rate(fps0), _rate(fps1)))


def _rate(text: str) -> float:
    try:
        return min(float(text), _HIGHEST_FPS)
    except ValueError:
        return math.nan


def _checked(mode: Mode) -> Mode | None:
    """Return a mode that a camera can have; None for another."""
    sides = all(
        a in _SIDES and b in _SIDES and a <= b for a, b in zip(mode.least, mode.most, strict=True)
    )
    return mode if sides and 0.0 < mode.least_fps <= mode.most_fps else None
