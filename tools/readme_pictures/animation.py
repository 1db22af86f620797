# SPDX-License-Identifier: GPL-3.0-or-later
"""The README's animation: the sample clip, the captured body over it, and the same motion from the side."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.media.video import open_video
from ...scope_addon.errors import OutputError
from .clips import SAMPLE, captured, default_body
from .footage import cropped
from .panel import Panel, next_to_each_other
from .shapes import joints, posed
from .view import from_around

FRAME_STEP = 2  # every second frame: 15 frames per second
LARGEST_BYTES = 3_000_000
_SIZE = (300, 306)  # of one panel, pixels
_CORNER, _TALL = (60.0, 0.0), 480.0  # the part of the footage that is shown: the person stays inside it
_MIDDLE, _HEIGHT_M = np.array([0.35, 0.0, 0.93]), 2.35  # centre and height of the side view


def sample_frames() -> list[NDArray[np.uint8]]:
    """Return (H, W, 3) RGB frames: footage, overlay and side view next to each other."""
    motion = captured(SAMPLE)[0]
    rows = {int(frame): row for row, frame in enumerate(motion.frames)}
    view = from_around(motion, 0, _MIDDLE, _SIZE, 90, _HEIGHT_M)
    frames = []
    with open_video(SAMPLE) as video:
        for frame in video:
            if frame.index % FRAME_STEP or frame.index not in rows:
                continue
            row = rows[frame.index]
            footage = cropped(frame.image_rgb, _CORNER, _TALL, _SIZE)
            overlay = cropped(frame.image_rgb, _CORNER, _TALL, _SIZE, motion, row)
            side = Panel(view, joints(motion, 0)[0])
            side.body(default_body(), posed(motion, default_body(), row))
            frames.append(next_to_each_other([footage, overlay, side.finished()]))
    return frames


def write_webp(path: Path, frames: list[NDArray[np.uint8]], frames_per_second: float) -> int:
    """Write an endless animated WebP, at the best quality that stays below ``LARGEST_BYTES``; returns that quality.

    :param frames: (H, W, 3) uint8 RGB, all of one size.
    :raises OutputError: when the file cannot be written, or is too large at every quality.
    """
    animation = cv2.Animation()
    animation.frames = [cv2.cvtColor(frame, cv2.COLOR_RGB2BGR) for frame in frames]
    animation.durations = [round(1000 / frames_per_second)] * len(frames)
    for quality in range(85, 25, -10):
        if not cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, quality]):
            raise OutputError(f"cannot write {path}; check that its folder exists and is writable")
        if path.stat().st_size <= LARGEST_BYTES:
            return quality
    raise OutputError(f"{path} is larger than {LARGEST_BYTES} bytes at every quality; show fewer frames")
