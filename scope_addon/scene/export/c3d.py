# SPDX-License-Identifier: GPL-3.0-or-later
"""Points over time in the C3D format of biomechanics (c3d.org), of its floating-point form.

A file is a header, parameters in named groups, and frames, each in blocks of 512 bytes, in the
byte order of Intel's processors. A point in a frame is x, y, z and a fourth number: -1 where the
point is missing, or else the residual in units of the scale, an integer from 0 to 255. A negative
scale says that coordinates are floating-point numbers. Free of bpy.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from ...arrays import Float64Array

_BLOCK = 512  # bytes
_POINTS = 32  # in a block
_PARAMETER_BLOCK = 2  # counted from 1
_MAGIC = 0x50
_INTEL = 84
_SCALE_MM = -1.0
_LARGEST_RESIDUAL = 255
_LARGEST_COUNT = 0xFFFF  # of frames, by numbers of 16 bits
_MISSING = -1.0
_CHARACTERS = -1
_INTEGERS = 2
_FLOATS = 4
Parameter = tuple[int, Sequence[int], bytes]  # kind of its values, their dimensions, and themselves


def c3d_bytes(
    labels: Sequence[str],
    descriptions: Sequence[str],
    points_mm: Float64Array,
    residuals_mm: Float64Array,
    rate: float,
    first: int,
) -> bytes:
    """Return the content of a file.

    :param labels: of the M points.
    :param descriptions: likewise, what they are.
    :param points_mm: (T, M, 3) millimetres, x to the right and z up in the programs' views.
    :param residuals_mm: (T, M); negative where a point is missing, NaN where it is not known, which
        is written as 0.
    :param rate: frames per second.
    :param first: number of the first frame, from 1.
    """
    frames, count = points_mm.shape[:2]
    last = first + frames - 1
    # The number of the block of data is the same length whatever it is.
    parameters = _parameter_section(labels, descriptions, frames, rate, first, 0)
    data_block = _PARAMETER_BLOCK + len(parameters) // _BLOCK
    parameters = _parameter_section(labels, descriptions, frames, rate, first, data_block)
    header = struct.pack(
        "<BBHHHHHfHHf",
        *(_PARAMETER_BLOCK, _MAGIC),
        *(count, 0, min(first, _LARGEST_COUNT), min(last, _LARGEST_COUNT)),
        *(0, _SCALE_MM, data_block, 0, rate),
    )
    is_missing = residuals_mm < 0
    known = np.nan_to_num(np.round(residuals_mm), nan=0.0)
    rows = np.empty((frames, count, 4), "<f4")
    rows[..., :3] = np.where(is_missing[..., None], 0.0, points_mm)
    rows[..., 3] = np.where(is_missing, _MISSING, np.clip(known, 0, _LARGEST_RESIDUAL))
    # Some readers take what fills the last block for points: for them, it is missing ones.
    padding = np.tile(np.array([0.0, 0.0, 0.0, _MISSING], "<f4"), (-frames * count % _POINTS, 1))
    return _padded(header) + parameters + rows.tobytes() + padding.tobytes()


def _parameter_section(
    labels: Sequence[str],
    descriptions: Sequence[str],
    frames: int,
    rate: float,
    first: int,
    data_block: int,
) -> bytes:
    """Return the groups of parameters, in whole blocks."""
    last = first + frames - 1
    groups: dict[str, dict[str, Parameter]] = {
        "POINT": {
            "USED": _integers(len(labels)),
            "SCALE": _floats(_SCALE_MM),
            "RATE": _floats(rate),
            "DATA_START": _integers(data_block),
            "FRAMES": _integers(min(frames, _LARGEST_COUNT)),
            # What 16 bits do not hold.
            "LONG_FRAMES": _floats(frames),
            "LABELS": _texts(labels),
            "DESCRIPTIONS": _texts(descriptions),
            "UNITS": _texts(["mm"]),
            "X_SCREEN": _texts(["+X"]),
            "Y_SCREEN": _texts(["+Z"]),
        },
        "TRIAL": {
            "ACTUAL_START_FIELD": _integers(first & 0xFFFF, first >> 16),
            "ACTUAL_END_FIELD": _integers(last & 0xFFFF, last >> 16),
        },
        "ANALOG": {"USED": _integers(0)},
    }
    entries = []
    for number, (group, parameters) in enumerate(groups.items(), 1):
        entries.append(_entry(group, -number, b""))
        for name, (kind, dimensions, values) in parameters.items():
            sizes = bytes([len(dimensions), *dimensions])
            entries.append(_entry(name, number, struct.pack("<b", kind) + sizes + values))
    content = b"".join(entries) + bytes(2)
    blocks = -(-(4 + len(content)) // _BLOCK)
    return _padded(bytes([1, _MAGIC, blocks, _INTEL]) + content)


def _entry(name: str, number: int, content: bytes) -> bytes:
    """Return a group, whose number is negative, or a parameter; it ends with an empty description.

    The offset to the next entry counts its own two bytes.
    """
    head = struct.pack("<bb", len(name), number) + name.encode("ascii")
    return head + struct.pack("<H", 2 + len(content) + 1) + content + bytes(1)


def _integers(*values: int) -> Parameter:
    dimensions = [len(values)] if len(values) > 1 else []
    return _INTEGERS, dimensions, struct.pack(f"<{len(values)}H", *values)


def _floats(value: float) -> Parameter:
    return _FLOATS, [], struct.pack("<f", value)


def _texts(texts: Sequence[str]) -> Parameter:
    """Return a parameter of texts, which are padded with spaces to the same length."""
    width = max(map(len, texts), default=0)
    content = "".join(text.ljust(width) for text in texts)
    return _CHARACTERS, [width, len(texts)], content.encode("ascii")


def _padded(content: bytes) -> bytes:
    """Return the content with zeros up to the end of its last block."""
    return content + bytes(-len(content) % _BLOCK)
