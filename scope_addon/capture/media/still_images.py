# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a picture file as upright 8-bit RGB: a still, or one frame of an image sequence.

OpenCV reads JPEG, PNG, WebP, TIFF and BMP. It could read others, in which a few hundred bytes can
take gigabytes, and which nobody films in: these are refused. Its packages do not read AVIF and
HEIC, which PyAV decodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from ...arrays import Float32Array, Uint8Array
from ...errors import VideoError
from ...exif import PNG, TIFF, animation_length, png_chunks, read_exif, tiff_size
from ...footage import MAX_PICTURE_BYTES
from ...untrusted.files import check_regular
from .frame_readers import decode_items
from .guards import check_depth, check_size, too_large, utf8_name
from .heif import assemble, read_layout
from .quicktime import sequence_length

_JPEG_STREAMS = (".mjpeg", ".mjpg")  # begin like a JPEG, but are videos
_HEIF_BRANDS = {b"mif1", b"heic", b"heix", b"heim", b"heis", b"avif"}  # of ISO 23008-12 and of AVIF
_OPENEXR = b"v/1\x01"
_GIF = b"GIF8"
_READ = (PNG, *TIFF, b"\xff\xd8\xff", b"BM")  # how files begin that OpenCV is given; and WebP
_ROWS = 256  # that are converted at a time


@dataclass(frozen=True)
class StillImage:
    """``rgb`` (H, W, 3) uint8; ``focal_35mm`` in mm on a 36 × 24 mm frame; ``length`` more than 1
    for an animation.
    """

    rgb: Uint8Array
    focal_35mm: float | None = None
    length: int = 1


def is_picture(path: Path) -> bool:
    """Check by its content whether a file is a picture that can be read, rather than a video or
    anything else.

    :raises VideoError: it is a picture in a format that is not read.
    """
    with path.open("rb") as file:
        head = file.read(64)
    if _brands(head) & _HEIF_BRANDS:
        return True
    if head.startswith(_GIF) or path.suffix.lower() in _JPEG_STREAMS:
        return False
    if _is_for_opencv(head):
        return True
    with utf8_name(path) as name:
        if head.startswith(_OPENEXR) or cv2.haveImageReader(name):
            raise VideoError(
                f"{path} is an image in a format that is not supported; export it as "
                "PNG, TIFF or JPEG"
            )
    return False


def read_picture(path: Path) -> StillImage | None:
    """Decode a picture; None if that fails. Transparent parts become white, except in AVIF and
    HEIC.

    :raises VideoError: it is too large, deep or long (see `guards`), or AVIF or HEIC, and PyAV
        is not installed.
    """
    check_regular(path, VideoError, "picture", MAX_PICTURE_BYTES)
    data = path.read_bytes()
    if _brands(data[:64]) & _HEIF_BRANDS:
        return _read_heif(path, data)
    if not _is_for_opencv(data[:64]):
        return None
    if data.startswith(PNG) and not _holds_its_chunks(data):
        return None  # OpenCV would take as much memory as the chunk claims
    if data.startswith(TIFF):
        check_depth(path, *tiff_size(data))
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
    if not data.startswith(TIFF):  # OpenCV rotates a TIFF upright even with IMREAD_UNCHANGED
        rgb = exif.view.show(rgb)
    return StillImage(rgb, exif.focal_35mm, animation_length(data))


def _is_for_opencv(head: bytes) -> bool:
    return head.startswith(_READ) or (head[:4], head[8:12]) == (b"RIFF", b"WEBP")


def _holds_its_chunks(data: bytes) -> bool:
    """Return whether a PNG has an end, and no chunk up to it claims more bytes than follow it."""
    for name, content, size in png_chunks(data):
        if len(content) != size:
            return False
        if name == b"IEND":
            return True
    return False


def _brands(head: bytes) -> set[bytes]:
    """Read the compatible brands of an ISO base media file (MP4, HEIC, AVIF, ...); empty for other
    files.
    """
    if head[4:8] != b"ftyp":
        return set()
    size = min(int.from_bytes(head[:4], "big"), len(head))
    return {head[at : at + 4] for at in (8, *range(16, size - 3, 4))}


def _read_heif(path: Path, data: bytes) -> StillImage | None:
    layout = read_layout(data)
    if layout is None:
        return None
    whole = assemble(layout, decode_items(path, set(layout.tiles.ravel().tolist())))
    if whole is None:
        return None
    check_size(path, whole.shape[1], whole.shape[0])
    length = max(1, sequence_length(path))
    return StillImage(whole, read_exif(layout.exif).focal_35mm, length)


def _as_rgb8(image: NDArray[Any]) -> Uint8Array:
    """Convert grey, BGR or BGRA of any depth to RGB uint8, on white where it is transparent.

    A few rows at a time: as numbers with a fraction, a whole image may take several gigabytes.
    """
    rgb = np.empty((*image.shape[:2], 3), np.uint8)
    for start in range(0, len(image), _ROWS):
        rgb[start : start + _ROWS] = _rows_as_rgb8(image[start : start + _ROWS])
    return rgb


def _rows_as_rgb8(image: NDArray[Any]) -> Uint8Array:
    if image.dtype == np.uint16:
        image = cv2.convertScaleAbs(image, alpha=1 / 257)
    elif image.dtype != np.uint8:
        image = (np.clip(np.nan_to_num(image), 0, 1) * 255 + 0.5).astype(np.uint8)
    if image.ndim == 2:
        return cast(Uint8Array, cv2.cvtColor(image, cv2.COLOR_GRAY2RGB))
    if image.shape[2] == 4:
        image = _on_white(image)
    return cast(Uint8Array, cv2.cvtColor(image, cv2.COLOR_BGR2RGB))


def _on_white(bgra: Uint8Array) -> Uint8Array:
    alpha = bgra[..., 3:].astype(np.float32) / 255
    blended: Float32Array = bgra[..., :3] * alpha + 255 * (1 - alpha) + 0.5
    return blended.astype(np.uint8)
