# SPDX-License-Identifier: GPL-3.0-or-later
"""Videos of two people, composed of real clips of one man whose true position is known."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import cv2
import numpy as np

FRAMES = range(0, 100, 4)  # of the clips, which have 60 per second


@cache
def panels(shared: Path, camera: str) -> tuple[list[np.ndarray], np.ndarray]:
    """The middle of `FRAMES` of a clip, 500 pixels high, and the true centre of the trunk in each,
    (25, 2) pixels.
    """
    truth = np.load(shared / f"data/pose2sim/truth_{camera}.npz")
    names = [str(n) for n in truth["names"]]
    trunk = [names.index(n) for n in ("LShoulder", "RShoulder", "LHip", "RHip")]
    at = np.full((100, 2), np.nan)
    at[truth["frame_index"]] = np.nanmean(truth["uv"][:, trunk], axis=1)
    left = 60
    top = 330
    right = 860
    bottom = 1330
    video = cv2.VideoCapture(str(shared / f"data/pose2sim/{camera}.mp4"))
    images = []
    for t in range(FRAMES.stop):
        video.grab()
        if t in FRAMES:
            image = cv2.resize(
                video.retrieve()[1][top:bottom, left:right],
                (400, 500),
                interpolation=cv2.INTER_AREA,
            )
            images.append(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
    return images, (at[FRAMES] - [left, top]) / 2


def composite(
    shared: Path, cameras: tuple[str, str], crossing: bool
) -> Iterator[tuple[np.ndarray, np.ndarray, bool]]:
    """Frames, true positions (2, 2), and whether the first person is occluded; the second one
    passes in front.

    15 per second, as of `visit`.
    """
    (back, back_at), (front, front_at) = (panels(shared, camera) for camera in cameras)
    for k, t in enumerate(FRAMES):
        x = [round(11 * t), round(11 * (99 - t))] if crossing else [0, 700]
        image = np.full((520, 1500, 3), 140, np.uint8)
        for offset, panel in zip(x, (back[k], front[k]), strict=True):
            image[:500, offset : offset + 400] = panel
        places = np.stack([back_at[k] + [x[0], 0], front_at[k] + [x[1], 0]])
        yield image, places, bool(x[1] < places[0, 0] < x[1] + 400)


def visit(shared: Path) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Frames and true positions (2, 2): the first person stays, the second enters and leaves at the
    right edge.

    The background has enough texture to show that the camera is static.
    """
    (stays, stays_at), (visits, visits_at) = (panels(shared, camera) for camera in ("cam3", "cam2"))
    noise = np.random.default_rng(3).integers(60, 200, (26, 60, 3), np.uint8)
    background = cv2.resize(noise, (1200, 520), interpolation=cv2.INTER_CUBIC)
    for k, t in enumerate(FRAMES):
        x = round(1200 - 520 * np.sin(np.pi * max(t - 10, 0) / 80)) if t < 90 else 1200
        image = background.copy()
        image[:500, :400] = stays[k]
        width = max(min(400, 1200 - x), 0)
        image[:500, x : x + width] = visits[k][:, :width]
        yield image, np.stack([stays_at[k], visits_at[k] + [x, 0]])


def distant_view(image: np.ndarray) -> np.ndarray:
    """The image at an eighth of its size, with its top left corner at (400, 200) of 1280 × 720
    pixels.
    """
    small = cv2.resize(image, None, fx=1 / 8, fy=1 / 8, interpolation=cv2.INTER_AREA)
    height, width = small.shape[:2]
    return cv2.copyMakeBorder(small, 200, 520 - height, 400, 880 - width, cv2.BORDER_REPLICATE)


def beside(large: np.ndarray, small: np.ndarray) -> np.ndarray:
    """The large image of 576 × 576 pixels, and right of it, at (800, 200), the small one with a
    height of 180.
    """
    height, width = small.shape[:2]
    there = cv2.resize(small, (round(180 * width / height), 180), interpolation=cv2.INTER_AREA)
    image = cv2.copyMakeBorder(large, 0, 0, 0, 600, cv2.BORDER_REPLICATE)
    image[200:380, 800 : 800 + there.shape[1]] = there
    return image
