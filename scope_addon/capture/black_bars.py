# SPDX-License-Identifier: GPL-3.0-or-later
"""Black bars round a picture: an upright clip in a wide video, a film on an upright screen.

They belong to no camera: what the camera saw, and how wide it saw it, lies between them. Their edges are straight, and
mean nothing.
"""

from __future__ import annotations

import numpy as np

DARK = 24  # of 255, in every channel: black, after compression
STRAY = 0.01  # share of a line of a bar that is brighter all the same
THINNEST = 0.03  # of the side
BEGINS = 0.25  # share of the picture's outermost lines that is brighter; less: a dark place that fades into the picture
EDGE_PX = 6  # in which the bar's edge lies
UNEVEN = 0.01  # of the side, by which bars that face each other may differ


def find_bars(image_rgb: np.ndarray) -> list[np.ndarray]:
    """(4,) x0, y0, x1, y1 of the bars of an (H, W, 3) uint8 image, each up to the picture; pairs that face each other.

    Only bars of one width are such: a night sky has no counterpart.
    """
    bright = image_rgb.max(axis=2) > DARK
    height, width = bright.shape
    bars = []
    left, right = _pair(bright.mean(axis=0))
    if left:
        bars += [np.array([0.0, 0.0, left, height]), np.array([width - right, 0.0, width, height], float)]
    top, bottom = _pair(bright[:, left : width - right].mean(axis=1))
    if top:
        bars += [np.array([0.0, 0.0, width, top]), np.array([0.0, height - bottom, width, height], float)]
    return bars


def longer_side_between(bars: list[np.ndarray], width: int, height: int) -> float:
    """The longer side of what a picture of this size has between its bars."""
    thick = np.array([bar[2:] - bar[:2] for bar in bars]).reshape(-1, 2)
    upright = thick[:, 1] == height
    return float(max(width - thick[upright, 0].sum(), height - thick[~upright, 1].sum()))


def _pair(bright: np.ndarray) -> tuple[int, int]:
    """Widths of the bars at both ends of lines of which a share is ``bright`` (n,); 0, 0 if there is no such pair."""
    n, picture = len(bright), np.flatnonzero(bright > STRAY)
    if not len(picture):
        return 0, 0
    first, last = int(picture[0]), int(picture[-1])
    begin, end = first, n - 1 - last
    sharp = min(bright[first : first + EDGE_PX].max(), bright[max(0, last - EDGE_PX + 1) : last + 1].max()) >= BEGINS
    if not sharp or min(begin, end) < THINNEST * n or abs(begin - end) > max(2.0, UNEVEN * n):
        return 0, 0
    return begin, end
