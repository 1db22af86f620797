# SPDX-License-Identifier: GPL-3.0-or-later
"""Bars beside or above a picture: an upright clip in a wide video, a film on an upright screen.

They are black, of another colour, or a blurred copy of the picture, and belong to no camera: what the camera saw, and
how wide it saw it, lies between them. Their edges are straight, and mean nothing.
"""

from __future__ import annotations

import cv2
import numpy as np

THINNEST = 0.03  # of the side
UNEVEN = 0.01  # of the side, by which bars that face each other may differ
DARK = 24  # of 255, in every channel: black, after compression
STRAY = 0.01  # share of a line of a black bar that is brighter all the same
BEGINS = 0.25  # share of the picture's outermost lines that is brighter; less: a dark place that fades into the picture
EDGE_PX = 6  # in which a black bar's edge lies
# A bar of anything else ends in a step along one line of pixels, and has few details.
STEP, STEPS = 8, 0.7  # of 255; and the share of the line
DETAIL = 0.2  # of the picture's, on average


def find_bars(image_rgb: np.ndarray) -> list[np.ndarray]:
    """(4,) x0, y0, x1, y1 of the bars of an (H, W, 3) uint8 image, each up to the picture; pairs that face each other.

    Only bars of one width are such: a night sky has no counterpart.
    """
    bright, grey = image_rgb.max(axis=2) > DARK, cv2.cvtColor(image_rgb, cv2.COLOR_RGB2GRAY)
    height, width = bright.shape
    bars = []
    left, right = _black(bright.mean(axis=0)) or _framed(grey) or (0, 0)
    if left:
        bars += [np.array([0.0, 0.0, left, height]), np.array([width - right, 0.0, width, height], float)]
    inner = slice(left, width - right)
    top, bottom = _black(bright[:, inner].mean(axis=1)) or _framed(grey[:, inner].T) or (0, 0)
    if top:
        bars += [np.array([0.0, 0.0, width, top]), np.array([0.0, height - bottom, width, height], float)]
    return bars


def longer_content_side(bars: list[np.ndarray], width: int, height: int) -> float:
    """The longer side of what a picture of this size has between its bars."""
    thick = np.array([bar[2:] - bar[:2] for bar in bars]).reshape(-1, 2)
    upright = thick[:, 1] == height
    return float(max(width - thick[upright, 0].sum(), height - thick[~upright, 1].sum()))


def _black(bright: np.ndarray) -> tuple[int, int] | None:
    """Widths of black bars at both ends of lines of which a share is ``bright`` (n,)."""
    n, picture = len(bright), np.flatnonzero(bright > STRAY)
    if not len(picture):
        return None
    first, last = int(picture[0]), int(picture[-1])
    begin, end = first, n - 1 - last
    sharp = min(bright[first : first + EDGE_PX].max(), bright[max(0, last - EDGE_PX + 1) : last + 1].max()) >= BEGINS
    return (begin, end) if sharp and min(begin, end) >= THINNEST * n and abs(begin - end) <= _unevenness(n) else None


def _framed(grey: np.ndarray) -> tuple[int, int] | None:
    """Widths of bars of whatever kind on the left and right of a picture (rows, n)."""
    n = grey.shape[1]
    steps = (cv2.absdiff(grey[:, 1:], grey[:, :-1]) > STEP).mean(axis=0)
    edges = np.flatnonzero(steps >= STEPS) + 1
    begins, ends = edges[edges < n / 2], n - edges[edges > n / 2]
    reach = np.abs(begins[:, None] - ends) <= _unevenness(n)
    pairs = [(int(begins[i]), int(ends[j])) for i, j in np.argwhere(reach)]
    pairs = [pair for pair in pairs if min(pair) >= max(THINNEST * n, 4) and n - sum(pair) > 4]
    if not pairs:
        return None
    of_lines = np.abs(cv2.Laplacian(np.ascontiguousarray(grey), cv2.CV_16S)).mean(axis=0)
    detail = np.concatenate([[0.0], np.cumsum(of_lines)])

    def mean(first: int, end: int) -> float:
        return float(detail[end] - detail[first]) / (end - first)

    for begin, end in sorted(pairs, reverse=True):  # each edge itself, two lines wide, is neither's
        outside = max(mean(0, begin - 2), mean(n - end + 2, n))
        if outside <= DETAIL * mean(begin + 2, n - end - 2):
            return begin, end
    return None


def _unevenness(n: int) -> float:
    return max(2.0, UNEVEN * n)
