# SPDX-License-Identifier: GPL-3.0-or-later
"""Phone pictures: in one piece or in tiles, rotated, with a focal length, damaged, and
malicious.
"""

from __future__ import annotations

import struct
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.media import frame_readers
from scope.scope_addon.capture.media.frame_readers import decode_items
from scope.scope_addon.capture.media.heif import assemble, read_layout
from scope.scope_addon.capture.media.still_images import read_picture
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.errors import VideoError

from ...heif_files import heic

W = 150
H = 100


def slopes(width: int = W, height: int = H) -> np.ndarray:
    """Create a picture without any symmetry."""
    y, x = np.mgrid[:height, :width]
    return np.stack([255 * x / width, 255 * y / height, 90 + 0 * x], axis=-1).astype(np.uint8)


def read(path: Path, data: bytes) -> np.ndarray:
    path.write_bytes(data)
    with open_video(path) as video:
        (frame,) = video
    assert video.frame_count == 1
    return frame.image_rgb.astype(int)


@pytest.mark.parametrize(("name", "tile"), [("IMG_0001.HEIC", 64), ("a.jpg", None)])
def test_tiles_are_assembled(tmp_path: Path, name: str, tile: int | None) -> None:
    found = read(tmp_path / name, heic(slopes(), tile))
    assert found.shape == (H, W, 3)
    assert np.abs(found - slopes()).mean() < 3


@pytest.mark.parametrize(
    ("turns", "tile", "expected"),
    [
        # 90° anticlockwise: right becomes top
        ([("irot", 1)], 64, lambda a: a.transpose(1, 0, 2)[::-1]),
        ([("irot", 3)], None, lambda a: a[::-1].transpose(1, 0, 2)),
        ([("imir", 0)], None, lambda a: a[::-1]),
        ([("imir", 1), ("irot", 1)], None, lambda a: a[:, ::-1].transpose(1, 0, 2)[::-1]),
    ],
    ids=["left turn", "right turn", "upside down", "mirrored, left turn"],
)
def test_rotations_and_mirroring_are_applied(
    tmp_path: Path, turns: list, tile: int | None, expected
) -> None:
    found = read(tmp_path / "a.heic", heic(slopes(), tile, turns))
    wanted = expected(slopes().astype(int))
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).mean() < 3


def test_the_focal_length_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.heic").write_bytes(heic(slopes(), 64, focal_mm=26))
    with open_video(tmp_path / "a.heic") as video:
        assert video.focal_35mm == 26


def test_numbered_pictures_are_a_sequence(tmp_path: Path) -> None:
    for k in (1, 2):
        (tmp_path / f"IMG_{k}.HEIC").write_bytes(heic(np.full((64, 64, 3), 60 * k, np.uint8)))
    with open_video(tmp_path, VideoRange(fps=Fraction(10))) as video:
        assert [int(frame.image_rgb.mean()) for frame in video] == pytest.approx([60, 120], abs=4)


@pytest.mark.parametrize(
    "grid",
    [
        struct.pack(">BBBBHH", 0, 0, 1, 2, 193, 129),  # larger than its tiles
        struct.pack(">BBBBHH", 0, 0, 0, 2, W, H),  # fewer of them than there are
        struct.pack(">BBBBHH", 0, 0, 255, 255, W, H),
        struct.pack(">BBBBII", 0, 1, 1, 2, 1 << 31, 1 << 31),
        struct.pack(">BBBBHH", 0, 0, 1, 2, 0, 0),
        b"\0",
    ],
)
def test_an_impossible_grid_is_refused(tmp_path: Path, grid: bytes) -> None:
    (tmp_path / "a.heic").write_bytes(heic(slopes(), 64, grid=grid))
    with pytest.raises(VideoError, match=r"a\.heic is an image that cannot be decoded"):
        open_video(tmp_path / "a.heic")


def test_tiles_of_different_sizes_are_refused() -> None:
    layout = read_layout(heic(slopes(), 64))
    assert layout is not None
    pieces = {n: np.zeros((64, 64, 3), np.uint8) for n in layout.tiles.ravel().tolist()}
    assert assemble(layout, pieces) is not None
    assert assemble(layout, pieces | {3: np.zeros((64, 32, 3), np.uint8)}) is None
    del pieces[3]
    assert assemble(layout, pieces) is None


def test_damaged_files_raise_only_video_errors(tmp_path: Path) -> None:
    whole = heic(slopes(64, 48), 32)
    path = tmp_path / "a.heic"
    for size in (30, 100, 300, len(whole) // 2, len(whole) - 40):
        path.write_bytes(whole[:size])
        with pytest.raises(VideoError, match=r"a\.heic"):
            open_video(path)
    whole = heic(slopes(64, 48), 32, focal_mm=26)
    rng = np.random.default_rng(0)
    boxes = whole.index(b"mdat")
    refused = 0
    for _ in range(50):
        broken = bytearray(whole)
        for at in rng.integers(24, boxes, 3):
            broken[at] = rng.integers(256)
        path.write_bytes(broken)
        picture = read_picture(path)
        refused += picture is None
        if picture is not None:  # harmless damage, or another turn
            assert picture.rgb.shape in {(48, 64, 3), (64, 48, 3)}
    assert 0 < refused < 50


def patched(data: bytes, name: bytes, content: bytes) -> bytes:
    """Replace the content of the first box of this name by one of at most the same length."""
    at = data.index(name) + 4
    return data[:at] + content + data[at + len(content) :]


def test_a_small_file_cannot_request_much_memory() -> None:
    """Repeated extents without a length; one extent of the whole file, many times."""
    whole = heic(slopes(64, 48), 32, focal_mm=26)
    at = whole.index(b"iloc")
    for sizes, parts in ((0x0000, 5 * struct.pack(">HHH", 1, 0, 65535)), (0x4400, b"")):
        places = parts or struct.pack(">HHH", 5, 0, 9) + 9 * struct.pack(">II", 0, len(whole))
        content = struct.pack(">IHH", 0, sizes, 5 if parts else 1) + places
        assert len(content) <= int.from_bytes(whole[at - 4 : at], "big") - 8
        assert read_layout(patched(whole, b"iloc", content)) is None


def test_decoding_stops_at_the_maximum_number_of_pixels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.heic"
    path.write_bytes(heic(slopes(), 64))
    monkeypatch.setattr(frame_readers, "MAX_PIXELS", 3 * 64 * 64)
    assert len(decode_items(path, {2, 3, 4})) == 3
    monkeypatch.setattr(frame_readers, "MAX_PIXELS", 3 * 64 * 64 - 1)
    assert decode_items(path, {2, 3, 4}) == {}


def test_a_box_that_contains_itself_terminates() -> None:
    whole = heic(slopes(64, 48), 32)
    at = whole.index(b"dimg") + 4
    # the grid's first tile is the grid itself
    assert read_layout(whole[: at + 4] + whole[at : at + 2] + whole[at + 6 :]) is None
    assert read_layout(b"\0\0\0\x08meta" * 3) is None
    assert read_layout(struct.pack(">I4sQ", 1, b"meta", 1 << 63)) is None
    assert read_layout(struct.pack(">I4s", 0, b"free") * 5) is None
