# SPDX-License-Identifier: GPL-3.0-or-later
"""AVCHD as camcorders write it, which no encoder here does: an H.264 stream in which each field is
a picture and a packet of its own (ITU-T H.264, 7.3; field_pic_flag), of plain samples (I_PCM).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from io import BytesIO
from pathlib import Path

import numpy as np

from ....required import package

av = package("av")
FIELDS_PER_S = 50
_TICKS_PER_S = 90_000


class _Bits:
    """A string of bits."""

    def __init__(self) -> None:
        self._bits: list[int] = []

    def fixed(self, *fields: tuple[int, int]) -> _Bits:
        """Append numbers, each with its count of bits."""
        for count, value in fields:
            self._bits += [value >> k & 1 for k in reversed(range(count))]
        return self

    def golomb(self, *values: int) -> _Bits:
        """Append numbers as Exp-Golomb codes, ue(v)."""
        for value in values:
            self.fixed((2 * (value + 1).bit_length() - 1, value + 1))
        return self

    def aligned(self) -> bytes:
        """Return the bits, with zeros up to a whole byte."""
        return np.packbits(np.array(self._bits, np.uint8)).tobytes()

    def ended(self) -> bytes:
        """Return the bits with the one that ends them."""
        return self.fixed((1, 1)).aligned()


def _unit(header: int, payload: bytes) -> bytes:
    """Return a unit of the stream: no three bytes in it look like the start of one."""
    out = bytearray()
    for byte in payload:
        if out[-2:] == b"\0\0" and byte <= 3:
            out.append(3)
        out.append(byte)
    return b"\0\0\0\1" + bytes([header]) + bytes(out)


def _parameters(height: int, width: int) -> bytes:
    sequence = _Bits().fixed((8, 77), (8, 0), (8, 30)).golomb(0, 0, 0, 4, 1).fixed((1, 0))
    sequence.golomb(width // 16 - 1, height // 32 - 1)
    sequence.fixed((1, 0), (1, 0), (1, 1), (1, 0), (1, 1), (4, 0))  # fields are allowed; timing
    sequence.fixed((1, 1), (32, 1), (32, FIELDS_PER_S), (1, 1), (4, 0))
    picture = _Bits().golomb(0, 0).fixed((2, 0)).golomb(0, 0, 0).fixed((3, 0)).golomb(0, 0, 0)
    return _unit(0x67, sequence.ended()) + _unit(0x68, picture.fixed((3, 0b100)).ended())


def _field(luma: np.ndarray, number: int, is_bottom: bool) -> bytes:
    """Return a field (h, W) as a picture: the top one refreshes the decoder."""
    bits = _Bits().golomb(0, 7, 0).fixed((4, 0), (1, 1), (1, is_bottom))
    if not is_bottom:
        bits.golomb(number % 2)
    bits.fixed((8, is_bottom), (1, 0) if is_bottom else (2, 0)).golomb(0, 1)
    parts = []
    height, width = luma.shape
    for y in range(0, height, 16):
        for x in range(0, width, 16):
            parts += [
                bits.golomb(25).aligned(),
                luma[y : y + 16, x : x + 16].tobytes(),
                b"\x80" * 128,
            ]
            bits = _Bits()
    parts.append(bits.ended())
    return _unit(0x21 if is_bottom else 0x65, b"".join(parts))


def write_field_pictures(path: Path, pictures: Sequence[np.ndarray]) -> Path:
    """Write an MPEG transport stream that shows one field of each picture, the even lines first.

    :param pictures: (H, W) uint8, H a multiple of 32 and W of 16.
    """
    parameters = _parameters(*pictures[0].shape)
    units = []
    for k, picture in enumerate(pictures):
        is_bottom = k % 2 == 1
        delimiter = _unit(9, b"\x10") + (b"" if is_bottom else parameters)
        units.append(delimiter + _field(picture[k % 2 :: 2], k // 2, is_bottom))
    with (
        av.open(BytesIO(b"".join(units)), format="h264") as plain,
        av.open(str(path), "w", format="mpegts") as container,
    ):
        stream = container.add_stream_from_template(plain.streams.video[0])
        for k, unit in enumerate(units):
            packet = av.Packet(unit)
            packet.stream = stream
            packet.time_base = Fraction(1, _TICKS_PER_S)
            packet.pts = packet.dts = k * _TICKS_PER_S // FIELDS_PER_S
            container.mux(packet)
    return path
