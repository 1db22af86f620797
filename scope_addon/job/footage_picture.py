# SPDX-License-Identifier: GPL-3.0-or-later
"""One frame of the footage, upright, turned and mirrored as a capture sees it, for the panel to
show. A process of its own decodes it, and writes it scaled down.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..errors import VideoError
from .process import PROGRESS_FIELDS, WorkerFailedError, WorkerProcess, is_number, is_side
from .request import PictureRequest

LONGER_SIDE = 1280  # pixels, of what is written
FILE = "picture.rgba"


@dataclass(frozen=True)
class FootagePicture:
    """A frame.

    :param pixels: RGBA bytes, bottom row first, as Blender expects.
    :param shown_size: width and height of ``pixels``.
    :param size: width and height of the frame that a capture sees.
    """

    pixels: bytes
    shown_size: tuple[int, int]
    size: tuple[int, int]
    time_s: float


def write_picture(request: PictureRequest, job_folder: Path, send: Callable[..., None]) -> None:
    """Write the frame, and report it.

    :raises VideoError: the footage cannot be decoded, or ends before the time.
    """
    import cv2

    from ..capture.media.video import open_video
    from ..capture.media.video_range import VideoRange
    from ..footage_view import FootageView, scaled_size

    view = FootageView(int(request.rotate), request.mirror)
    with open_video(request.footage, VideoRange(request.time_s, view=view)) as video:
        frame = next(video.frames_from(request.time_s), None)  # which need not count frames
    if frame is None:
        raise VideoError(f"{request.footage} has no frame at {request.time_s:.2f} s")
    height, width = frame.image_rgb.shape[:2]
    _, shown_size = scaled_size(width, height, min(LONGER_SIDE, max(width, height)))
    shown = cv2.resize(frame.image_rgb, shown_size, interpolation=cv2.INTER_AREA)
    rgba = cv2.cvtColor(shown, cv2.COLOR_RGB2RGBA)
    (job_folder / FILE).write_bytes(rgba[::-1].tobytes())
    send(
        "result",
        shown_width=shown_size[0],
        shown_height=shown_size[1],
        width=width,
        height=height,
        time_ms=round(1000.0 * frame.timestamp_s),
    )


class PictureProcess(WorkerProcess):
    """The process for one frame. Call ``answer`` regularly; ``close`` ends it at once."""

    fields = PROGRESS_FIELDS | {
        "result": {
            "shown_width": is_side,
            "shown_height": is_side,
            "width": is_number,
            "height": is_number,
            "time_ms": is_number,
        },
    }

    def answer(self) -> FootagePicture | None:
        """Return the frame; None as long as it is not there.

        :raises WorkerFailedError: there will be none.
        """
        for message in self.poll():
            if message["event"] == "result":
                shown_size = message["shown_width"], message["shown_height"]
                pixels = (self.job_folder / FILE).read_bytes()
                if len(pixels) != 4 * shown_size[0] * shown_size[1]:
                    raise WorkerFailedError("the frame of the footage is incomplete; try again")
                size = message["width"], message["height"]
                return FootagePicture(pixels, shown_size, size, message["time_ms"] / 1000.0)
        return None
