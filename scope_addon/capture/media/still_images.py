# SPDX-License-Identifier: GPL-3.0-or-later
"""One picture's file as upright 8-bit RGB, whether it is footage by itself or one of a sequence.

OpenCV reads JPEG, PNG, WebP, TIFF, BMP and others; AVIF and HEIC, which its packages leave out, go to PyAV.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ...errors import VideoError
from .exif import animation_length, read_exif
from .frame_readers import decode_items
from .heif import MOST_PIXELS, assemble, read_layout

_JPEG_STREAMS = (".mjpeg", ".mjpg")  # begin like a picture, but are many
_HEIF_BRANDS = {b"mif1", b"heic", b"heix", b"heim", b"heis", b"avif"}  # ISO 23008-12's, and AVIF's
_OPENEXR, _GIF = b"v/1\x01", b"GIF8"


@dataclass(frozen=True)
class Picture:
    """``rgb`` (H, W, 3) uint8; ``focal_35mm`` in mm on a 36 × 24 mm frame; ``length`` more than 1 for an animation."""

    rgb: np.ndarray
    focal_35mm: float | None = None
    length: int = 1


def is_picture(path: Path) -> bool:
    """Whether a file's content is a picture that can be read, rather than a video or none of both.

    :raises VideoError: it is a picture of a kind that cannot be read.
    """
    with path.open("rb") as file:
        head = file.read(64)
    if _brands(head) & _HEIF_BRANDS:
        return True
    if head.startswith(_OPENEXR):
        raise VideoError(f"{path} is an OpenEXR picture, which cannot be read here; export it as PNG or TIFF")
    if head.startswith(_GIF) or path.suffix.lower() in _JPEG_STREAMS:
        return False
    return bool(cv2.haveImageReader(str(path)))


def read_picture(path: Path) -> Picture | None:
    """The picture in a file, None where it cannot be decoded; what is transparent shows white, but in AVIF and HEIC.

    :raises VideoError: it is AVIF or HEIC, and PyAV is missing.
    """
    data = path.read_bytes()
    if _brands(data[:64]) & _HEIF_BRANDS:
        return _read_heif(path, data)
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:  # an empty file, or one too large
        image = None
    if image is None:
        return None
    exif = read_exif(data)
    rgb = _as_rgb8(image)
    if data[:4] not in (b"II*\0", b"MM\0*"):  # OpenCV turns a TIFF upright even when told not to
        rgb = _upright(rgb, exif.orientation)
    return Picture(rgb, exif.focal_35mm, animation_length(data))


def _brands(head: bytes) -> set[bytes]:
    """What an ISO base media file (MP4, HEIC, AVIF, ...) says it is compatible with; empty for others."""
    if head[4:8] != b"ftyp":
        return set()
    size = min(int.from_bytes(head[:4], "big"), len(head))
    return {head[at : at + 4] for at in (8, *range(16, size - 3, 4))}


def _read_heif(path: Path, data: bytes) -> Picture | None:
    layout = read_layout(data)
    if layout is None:
        return None
    whole = assemble(layout, decode_items(path, set(layout.tiles.ravel().tolist()), MOST_PIXELS))
    return None if whole is None else Picture(whole, read_exif(layout.exif).focal_35mm)


def _as_rgb8(image: np.ndarray) -> np.ndarray:
    """Grey, BGR or BGRA of any depth -> RGB uint8; what is transparent shows white."""
    if image.dtype == np.uint16:
        image = cv2.convertScaleAbs(image, alpha=1 / 257)
    elif image.dtype != np.uint8:
        image = (np.clip(np.nan_to_num(image), 0, 1) * 255 + 0.5).astype(np.uint8)
    if image.ndim == 2:
        return cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
    if image.shape[2] == 4:
        alpha = image[:, :, 3:].astype(np.float32) / 255
        image = (image[:, :, :3] * alpha + 255 * (1 - alpha) + 0.5).astype(np.uint8)
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def _upright(image: np.ndarray, orientation: int) -> np.ndarray:
    """Undo an EXIF orientation (1..8)."""
    if orientation in (5, 6, 7, 8):
        image = image.transpose(1, 0, 2)
    vertical, horizontal = orientation in (3, 4, 7, 8), orientation in (2, 3, 6, 7)
    return np.ascontiguousarray(image[:: -1 if vertical else 1, :: -1 if horizontal else 1])
