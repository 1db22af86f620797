# SPDX-License-Identifier: GPL-3.0-or-later
"""The README's animations: a clip, the captured body over it, and the same motion from the side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.media.video import open_video
from ...scope_addon.errors import OutputError
from .clips import body_with_face, captured_in_total, talk
from .footage import cropped
from .panel import OURS, Panel, next_to_each_other
from .shapes import colors_with_face, joints, posed
from .view import from_around

# That in Blender's window is made by ./scripts/blender --sid --guide --part tour.
LARGEST_BYTES = {"blender": 900_000, "talk": 390_000}


@dataclass(frozen=True)
class Cut:
    """What is shown of a clip: upper left corner and height of a part of the footage, and the view
    from the side.
    """

    size: tuple[int, int]  # of a panel with footage, pixels
    side: tuple[int, int]  # of the panel with the side view
    corner: tuple[float, float]
    tall: float
    middle: tuple[float, float, float]  # of the side view, metres
    height_m: float  # of the side view
    turn: float  # of the side view, degrees
    step: int  # frames of the footage for one of the animation

    @property
    def frames_per_second(self) -> float:
        """Of the animation; the clips have 30."""
        return 30 / self.step


# The person stays inside.
TALK = Cut((308, 240), (204, 240), (0.0, 26.0), 400.0, (0.0, -0.15, 1.375), 0.84, 60.0, 3)


def talk_frames() -> list[NDArray[np.uint8]]:
    """Return (H, W, 3) RGB frames of a talking person: footage, overlay and side view next to each
    other.
    """
    clip = talk()
    motion = captured_in_total(clip)
    body = body_with_face()
    rows = {int(frame): row for row, frame in enumerate(motion.frames)}
    view = from_around(motion, 0, np.array(TALK.middle), TALK.side, TALK.turn, TALK.height_m)
    frames = []
    with open_video(clip) as video:
        for frame in video:
            if frame.index % TALK.step or frame.index not in rows:
                continue
            row = rows[frame.index]
            part = (TALK.corner, TALK.tall, TALK.size)
            footage = cropped(frame.image_rgb, *part)
            overlay = cropped(frame.image_rgb, *part, motion, row, body)
            side = Panel(view, joints(motion, 0)[0])
            side.body(body, posed(motion, body, row), colors_with_face(body, OURS))
            frames.append(next_to_each_other([footage, overlay, side.finished()]))
    return frames


def write_webp(
    path: Path, frames: list[NDArray[np.uint8]], frames_per_second: float, most_bytes: int
) -> int:
    """Write an endless animated WebP, at the best quality that stays below a size; returns that
    quality.

    :param frames: (H, W, 3) uint8 RGB, all of one size.
    :raises OutputError: when the file cannot be written, or is too large at every quality.
    """
    animation = cv2.Animation()
    animation.frames = [cv2.cvtColor(frame, cv2.COLOR_RGB2BGR) for frame in frames]
    animation.durations = [round(1000 / frames_per_second)] * len(frames)
    for quality in range(85, 15, -10):
        if not cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, quality]):
            raise OutputError(f"cannot write {path}; check that its folder exists and is writable")
        if path.stat().st_size <= most_bytes:
            return quality
    raise OutputError(
        f"{path} is larger than {most_bytes} bytes at every quality; show fewer frames"
    )
