# SPDX-License-Identifier: GPL-3.0-or-later
"""The modes of a camera of Windows or macOS, read from what FFmpeg logs about it, and the one to
ask for.

dshow logs them on request. avfoundation has no such request, but logs them when it refuses a size.
Names of drivers and pins are in the same text, which is therefore read as if it could be anything.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

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
