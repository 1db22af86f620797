# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a picture file as upright 8-bit RGB: a still, or one frame of an image sequence.

OpenCV reads JPEG, PNG, WebP, TIFF, BMP and others. Its packages do not read AVIF and HEIC, which PyAV decodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from ....errors import VideoError
from ....footage import MAX_PIXELS
from ..file_names import utf8_name
from ..frame_readers import decode_items
from ..image_size import check_size, too_large
from .exif import PNG, animation_length, png_chunks, read_exif
from .heif import assemble, read_layout

_JPEG_STREAMS = (".mjpeg", ".mjpg")  # begin like a JPEG, but are videos
_HEIF_BRANDS = {b"mif1", b"heic", b"heix", b"heim", b"heis", b"avif"}  # of ISO 23008-12 and of AVIF
_OPENEXR, _GIF = b"v/1\x01", b"GIF8"


@dataclass(frozen=True)
class Picture:
    """``rgb`` (H, W, 3) uint8; ``focal_35mm`` in mm on a 36 × 24 mm frame; ``length`` more than 1 for an animation."""

    rgb: NDArray[np.uint8]
    focal_35mm: float | None = None
    length: int = 1


def is_picture(path: Path) -> bool:
    """Check by its content whether a file is a picture that can be read, rather than a video or anything else.

    :raises VideoError: it is a picture in a format that is not supported (OpenEXR).
    """
    with path.open("rb") as file:
        head = file.read(64)
    if _brands(head) & _HEIF_BRANDS:
        return True
    if head.startswith(_OPENEXR):
        raise VideoError(f"{path} is an OpenEXR image, which cannot be read here; export it as PNG or TIFF")
    if head.startswith(_GIF) or path.suffix.lower() in _JPEG_STREAMS:
        return False
    with utf8_name(path) as name:
        return bool(cv2.haveImageReader(name))


def read_picture(path: Path) -> Picture | None:
    """Decode a picture; None if that fails. Transparent parts become white, except in AVIF and HEIC.

    :raises VideoError: it is too large or too long (see `image_size`), or AVIF or HEIC, and PyAV is not installed.
    """
    data = path.read_bytes()
    if _brands(data[:64]) & _HEIF_BRANDS:
        return _read_heif(path, data)
    if data.startswith(PNG) and not _holds_its_chunks(data):
        return None  # OpenCV would take as much memory as the chunk claims
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        if "CV_IO_MAX_IMAGE" in str(error):
            raise too_large(path, "too many pixels") from error
        image = None  # an empty file
    if image is None:
        return None
    check_size(path, image.shape[1], image.shape[0])
    exif = read_exif(data)
    rgb = _as_rgb8(image)
    if data[:4] not in (b"II*\0", b"MM\0*"):  # OpenCV rotates a TIFF upright even with IMREAD_UNCHANGED
        rgb = _upright(rgb, exif.orientation)
    return Picture(rgb, exif.focal_35mm, animation_length(data))


def _holds_its_chunks(data: bytes) -> bool:
    """Return whether no chunk of a PNG claims more bytes than follow it."""
    chunks = takewhile(lambda chunk: chunk[0] != b"IEND", png_chunks(data))
    return all(len(content) == size for _, content, size in chunks)


def _brands(head: bytes) -> set[bytes]:
    """Read the compatible brands of an ISO base media file (MP4, HEIC, AVIF, ...); empty for other files."""
    if head[4:8] != b"ftyp":
        return set()
    size = min(int.from_bytes(head[:4], "big"), len(head))
    return {head[at : at + 4] for at in (8, *range(16, size - 3, 4))}


def _read_heif(path: Path, data: bytes) -> Picture | None:
    layout = read_layout(data)
    if layout is None:
        return None
    whole = assemble(layout, decode_items(path, set(layout.tiles.ravel().tolist()), MAX_PIXELS))
    if whole is None:
        return None
    check_size(path, whole.shape[1], whole.shape[0])
    return Picture(whole, read_exif(layout.exif).focal_35mm)


def _as_rgb8(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Convert grey, BGR or BGRA of any depth to RGB uint8, on white where it is transparent."""
    if image.dtype == np.uint16:
        image = cv2.convertScaleAbs(image, alpha=1 / 257)
    elif image.dtype != np.uint8:
        image = (np.clip(np.nan_to_num(image), 0, 1) * 255 + 0.5).astype(np.uint8)
    if image.ndim == 2:
        return cast(NDArray[np.uint8], cv2.cvtColor(image, cv2.COLOR_GRAY2RGB))
    if image.shape[2] == 4:
        image = _on_white(image)
    return cast(NDArray[np.uint8], cv2.cvtColor(image, cv2.COLOR_BGR2RGB))


def _on_white(bgra: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Blend with white, row by row: as numbers with a fraction, a whole image may take several gigabytes."""
    bgr = np.empty((*bgra.shape[:2], 3), np.uint8)
    for row, blended in zip(bgra, bgr, strict=True):
        alpha = row[:, 3:].astype(np.float32) / 255
        blended[:] = row[:, :3] * alpha + 255 * (1 - alpha) + 0.5
    return bgr


def _upright(image: NDArray[np.uint8], orientation: int) -> NDArray[np.uint8]:
    """Undo an EXIF orientation (1..8)."""
    if orientation in (5, 6, 7, 8):
        image = image.transpose(1, 0, 2)
    vertical, horizontal = orientation in (3, 4, 7, 8), orientation in (2, 3, 6, 7)
    return np.ascontiguousarray(image[:: -1 if vertical else 1, :: -1 if horizontal else 1])
