# SPDX-License-Identifier: GPL-3.0-or-later
"""A few frames of the overlay, spread over the clip, as small pictures of bounded size."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ..capture.media.video_range import FootageRange
from ..capture.overlay.overlay_video import painted_frames
from ..errors import OutputError
from ..motion import Motion

PICTURES = 40
LONGEST_SIDE = 800
MAX_BYTES = 5_000_000  # of all pictures of a page
_QUALITY = 74  # of WebP

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Picture:
    """A picture of one of the rows that the page shows: a WebP file."""

    row: int
    content: bytes
    width: int
    height: int

    @property
    def url(self) -> str:
        """Its content as a data URL."""
        return f"data:image/webp;base64,{base64.b64encode(self.content).decode('ascii')}"


def overlay_pictures(
    video: Path,
    motions: Sequence[Motion],
    body: Body,
    rows: NDArray[np.int64],
    wanted: FootageRange | None = None,
    progress: Progress | None = None,
) -> list[Picture]:
    """Return at most `PICTURES` frames of the overlay, in chronological order, of at most
    `MAX_BYTES` together.

    :param rows: (n,) rows of the motions that the page shows.
    :param wanted: the range of the footage that was captured.
    :param progress: called with (pictures done, pictures expected).
    :raises VideoError: the footage cannot be read.
    :raises ShapeError: a motion does not have the joints of the body.
    :raises OutputError: OpenCV cannot write WebP.
    """
    chosen = spread_rows(len(rows), PICTURES)
    row_of = dict(zip(motions[0].frames[rows[chosen]].tolist(), chosen.tolist(), strict=True))
    pictures = []
    for index, image in painted_frames(video, motions, body, list(row_of), wanted=wanted):
        pictures.append(small_picture(row_of[index], image))
        if progress is not None:
            progress(len(pictures), len(chosen))
    return bounded(pictures, MAX_BYTES)


def spread_rows(count: int, most: int) -> NDArray[np.int64]:
    """Return at most ``most`` of the rows from 0 to ``count`` − 1, (n,), spread evenly, the first
    and last included.
    """
    rows: NDArray[np.int64] = np.unique(
        np.round(np.linspace(0, count - 1, min(count, most))).astype(np.int64)
    )
    return rows


def small_picture(row: int, image: NDArray[np.uint8], longest_side: int = LONGEST_SIDE) -> Picture:
    """Return an RGB image, (H, W, 3) uint8, as a WebP picture of at most ``longest_side`` pixels.

    :raises OutputError: OpenCV cannot write WebP.
    """
    height, width = image.shape[:2]
    scale = min(1.0, longest_side / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA) if scale < 1 else image
    ok, data = cv2.imencode(
        ".webp", cv2.cvtColor(small, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_WEBP_QUALITY, _QUALITY]
    )
    if not ok:
        raise OutputError(
            "cannot make the report's images: this OpenCV cannot write WebP; install another"
        )
    return Picture(row, data.tobytes(), *size)


def bounded(pictures: list[Picture], most_bytes: int) -> list[Picture]:
    """Return the pictures, or every second, fourth, ... of them, so that all together are at most
    ``most_bytes``.
    """
    while len(pictures) > 1 and sum(len(picture.content) for picture in pictures) > most_bytes:
        pictures = pictures[::2]
    return pictures
