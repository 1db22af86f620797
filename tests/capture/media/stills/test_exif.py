# SPDX-License-Identifier: GPL-3.0-or-later
"""Orientation and focal length of images, against OpenCV's own reading, and damaged EXIF."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.exif import picture_view
from scope.scope_addon.footage import MAX_PICTURE_BYTES
from scope.scope_addon.footage_view import AS_IN_FILE

from ..corner_picture import H, W, corner_image, corners, encode


def exif_block(orientation: int, focal_35mm: int | None = None, endian: str = "<") -> bytes:
    """Build a TIFF directory with an orientation and, in its EXIF directory, a focal length."""
    entry = struct.Struct(endian + "HHIHH")
    main = [entry.pack(0x0112, 3, 1, orientation, 0)]
    inner = b""
    if focal_35mm:
        main.append(struct.pack(endian + "HHII", 0x8769, 4, 1, 8 + 2 + 24 + 4))
        inner = struct.pack(endian + "H", 1) + entry.pack(0xA405, 3, 1, focal_35mm, 0) + b"\0\0\0\0"
    head = b"II*\0" if endian == "<" else b"MM\0*"
    return head + struct.pack(endian + "IH", 8, len(main)) + b"".join(main) + b"\0\0\0\0" + inner


def jpeg_with_exif(image: np.ndarray, tiff: bytes) -> bytes:
    data = encode(".jpg", image)
    segment = b"Exif\0\0" + tiff
    return data[:2] + b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment + data[2:]


# Where each corner must come to lie, from the EXIF standard: orientation -> position of row 0 and
# column 0.
UPRIGHT = {1: "rgbw", 2: "grwb", 3: "wbgr", 4: "bwrg", 5: "rbgw", 6: "brwg", 7: "wgbr", 8: "gwrb"}


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_and_focal_length(tmp_path, orientation):
    path = tmp_path / "a.jpg"
    endian = "<" if orientation % 2 else ">"
    path.write_bytes(jpeg_with_exif(corner_image(), exif_block(orientation, 26, endian)))
    video = open_video(path)
    image = next(iter(video)).image_rgb
    assert corners(image) == UPRIGHT[orientation]
    assert (
        (video.width, video.height) == image.shape[1::-1] == ((W, H) if orientation < 5 else (H, W))
    )
    assert video.focal_35mm == 26
    theirs = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)
    np.testing.assert_array_equal(image, theirs)


def test_orientation_of_png_webp_and_tiff(tmp_path):
    block = exif_block(6)
    png = encode(".png", corner_image())
    cut = png.index(b"IDAT") - 4
    chunk = struct.pack(">I", len(block)) + b"eXIf" + block
    (tmp_path / "a.png").write_bytes(
        png[:cut] + chunk + struct.pack(">I", zlib.crc32(chunk[4:])) + png[cut:]
    )
    webp = encode(".webp", corner_image())
    block += b"\0" * (len(block) % 2)
    extended = (
        b"VP8X"
        + struct.pack("<II", 10, 8)
        + struct.pack("<I", W - 1)[:3]
        + struct.pack("<I", H - 1)[:3]
    )
    body = b"WEBP" + extended + webp[12:] + b"EXIF" + struct.pack("<I", len(block)) + block
    (tmp_path / "a.webp").write_bytes(b"RIFF" + struct.pack("<I", len(body)) + body)
    tiff = bytearray(encode(".tiff", corner_image()))
    start = struct.unpack_from("<I", tiff, 4)[0]
    count = struct.unpack_from("<H", tiff, start)[0]
    entries = [bytes(tiff[start + 2 + 12 * i : start + 14 + 12 * i]) for i in range(count)]
    entries = sorted(
        [*entries, struct.pack("<HHIHH", 0x0112, 3, 1, 6, 0)],
        key=lambda e: struct.unpack("<H", e[:2])[0],
    )
    struct.pack_into("<I", tiff, 4, len(tiff))
    (tmp_path / "a.tiff").write_bytes(
        tiff + struct.pack("<H", count + 1) + b"".join(entries) + b"\0\0\0\0"
    )
    for name in ("a.png", "a.webp", "a.tiff"):
        assert corners(next(iter(open_video(tmp_path / name))).image_rgb) == "brwg", name


def test_damaged_exif_counts_as_absent(tmp_path):
    for i, block in enumerate(
        (b"II*\0", b"II*\0\xff\xff\xff\xff", b"", exif_block(6)[:12], exif_block(99), b"XX" * 9)
    ):
        path = tmp_path / f"{i}.jpg"
        path.write_bytes(jpeg_with_exif(corner_image(), block))
        assert corners(next(iter(open_video(path))).image_rgb) == "rgbw"


def test_a_picture_that_a_capture_would_refuse_is_not_read_into_memory(tmp_path):
    """A motion file can name any file as its footage; this one has a hole of 1 GB."""
    path = tmp_path / "photo.jpg"
    path.write_bytes(jpeg_with_exif(corner_image(), exif_block(6)))
    assert picture_view(path).clockwise_deg == 90
    with path.open("r+b") as file:
        file.truncate(MAX_PICTURE_BYTES + 1)
    assert picture_view(path) == AS_IN_FILE
