# SPDX-License-Identifier: GPL-3.0-or-later
"""Focal length in QuickTime metadata, in files assembled here box by box."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.media.quicktime import focal_35mm
from scope.scope_addon.capture.media.video import open_video

from .made_video import write_video

KEY = b"com.apple.quicktime.camera.focal_length.35mm_equivalent"


def box(name: bytes, *payload: bytes) -> bytes:
    data = b"".join(payload)
    return struct.pack(">I4s", 8 + len(data), name) + data


def meta(kind: int, value: bytes, key: bytes = KEY, version: bytes = b"") -> bytes:
    """Build a meta box with the phone's make and, second, the key."""
    names = box(b"mdta", b"com.apple.quicktime.make") + box(b"mdta", key)
    make = box(struct.pack(">I", 1), box(b"data", struct.pack(">II", 1, 0), b"Telephone"))
    item = box(struct.pack(">I", 2), box(b"data", struct.pack(">II", kind, 0), value))
    return box(
        b"meta", version, box(b"keys", struct.pack(">II", 0, 2), names), box(b"ilst", make, item)
    )


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (21, struct.pack(">i", 26)),
        (22, b"\x1a"),
        (67, struct.pack(">i", 26)),
        (77, struct.pack(">I", 26)),
        (23, struct.pack(">f", 26.0)),
        (24, struct.pack(">d", 26.0)),
        (1, b"26"),
        (1, b"26.00mm"),
    ],
)
def test_values_of_each_type_in_movie_and_track(tmp_path, kind, value):
    path = tmp_path / "a.mov"
    head = box(b"ftyp", b"qt  ") + box(b"wide") + box(b"mdat", bytes(5000))
    for index in (
        box(b"mvhd", bytes(100)) + meta(kind, value),
        box(b"trak", meta(kind, value, version=bytes(4))),
    ):
        path.write_bytes(head + box(b"moov", index))
        assert focal_35mm(path) == 26.0


def test_absent_or_damaged_is_none(tmp_path):
    path = tmp_path / "a.mov"
    good = box(b"moov", meta(21, struct.pack(">i", 26)))
    damaged = [good[:n] for n in range(0, len(good), 7)]
    damaged += [box(b"moov", meta(21, struct.pack(">i", v))) for v in (0, -5, 10**6)]
    damaged += [
        box(b"moov", meta(1, b"wide")),
        box(b"moov", meta(99, b"x")),
        box(b"moov", meta(21, b"\x1a", b"other")),
    ]
    damaged += [
        b"\0" * 40,
        np.random.default_rng(0).bytes(3000),
        struct.pack(">I4sQ", 1, b"mdat", 1 << 60),
    ]
    for data in damaged:
        path.write_bytes(data)
        assert focal_35mm(path) is None
    assert focal_35mm(tmp_path / "missing.mov") is None


def test_a_video_has_its_focal_length(tmp_path: Path):
    path = write_video(tmp_path / "a.mp4", [np.full((48, 64, 3), 90, np.uint8)] * 3)
    assert open_video(path).focal_35mm is None
    data = bytearray(path.read_bytes())
    extra = meta(67, struct.pack(">i", 26))
    start = data.rindex(b"moov") - 4
    struct.pack_into(">I", data, start, struct.unpack_from(">I", data, start)[0] + len(extra))
    path.write_bytes(bytes(data) + extra)  # the index is the last box of the file
    video = open_video(path)
    assert video.focal_35mm == 26.0
    assert sum(1 for _ in video) == 3
