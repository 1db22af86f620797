# SPDX-License-Identifier: GPL-3.0-or-later
"""Show what the scenes look like: ``python -m scope.benchmarks.scenes.sheet OUT.jpg`` writes one
picture of several.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .scene import FOLDER

COLUMNS = 6
ROWS = 2
# of each picture
WIDTH = 200
HEIGHT = 200
QUALITY = 70


def sheet(clips: list[Path]) -> NDArray[np.uint8]:
    """Return the middle frames of the first clips that fill the sheet, each cut to its middle
    part.
    """
    tiles = [_middle(clip) for clip in clips[: COLUMNS * ROWS]]
    tiles += [np.zeros((HEIGHT, WIDTH, 3), np.uint8)] * (COLUMNS * ROWS - len(tiles))
    return np.vstack([np.hstack(tiles[row * COLUMNS : (row + 1) * COLUMNS]) for row in range(ROWS)])


def _middle(clip: Path) -> NDArray[Any]:
    video = cv2.VideoCapture(str(clip))
    video.set(cv2.CAP_PROP_POS_FRAMES, video.get(cv2.CAP_PROP_FRAME_COUNT) // 2)
    is_read, frame = video.read()
    if not is_read:
        raise ValueError(f"{clip} cannot be read: render it again")
    high, wide = frame.shape[:2]
    side = min(high, wide)
    top = (high - side) // 2
    left = (wide - side) // 2
    return cv2.resize(
        frame[top : top + side, left : left + side], (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA
    )


if __name__ == "__main__":
    cv2.imwrite(
        sys.argv[1], sheet(sorted(FOLDER.glob("test_*.mp4"))), [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
    )
