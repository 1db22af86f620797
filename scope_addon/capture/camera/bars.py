# SPDX-License-Identifier: GPL-3.0-or-later
"""Letterbox bars beside or above a picture: a portrait clip in a wide video, a film on a portrait
screen.

They are black, of another colour, or a blurred copy of the picture. They are not part of what the
camera saw: its image, and its field of view, end at the bars. Their edges are straight, but carry
no information.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...arrays import Float64Array, FloatArray, Uint8Array

MIN_WIDTH = 0.03  # of the side
MAX_DIFFERENCE = 0.01  # of the side, between the widths of opposite bars
DARK = 24  # of 255, in every channel: black, after compression
MAX_BRIGHT_SHARE = 0.01  # of a line of a black bar
# The least share of bright pixels in the picture's outermost lines; with less, a dark scene fades
# out.
MIN_EDGE_SHARE = 0.25
EDGE_PX = 6  # width of a black bar's edge
# Any other bar ends in a step along one line of pixels, and has little detail.
MIN_STEP = 8  # of 255
MIN_STEP_SHARE = 0.7  # of the line
# One edge of a pair may be fainter, as where a blurred floor goes on beside the floor: a step of
# half the line, which few pixels of the lines beside it have.
FAINT_STEP = 3  # of 255
FAINT_STEP_SHARE = 0.5
FAINT_SHARE_BESIDE = 0.25  # of the share of the line
MAX_DETAIL = 0.2  # of the picture's, on average


def find_bars(image_rgb: Uint8Array) -> list[Float64Array]:
    """Find pairs of opposite bars of equal width; a dark sky alone has no counterpart.

    :param image_rgb: (H, W, 3).
    :return: (4,) x0, y0, x1, y1 in pixels of each bar, up to the picture between them.
    """
    bright = image_rgb.max(axis=2) > DARK
    grey = cv2.cvtColor(image_rgb, cv2.COLOR_RGB2GRAY)
    height, width = bright.shape
    bars = []
    left, right = _black_bars(bright.mean(axis=0)) or _other_bars(grey) or (0, 0)
    if left:
        bars += [
            np.array([0.0, 0.0, left, height]),
            np.array([width - right, 0.0, width, height], float),
        ]
    inner = slice(left, width - right)
    top, bottom = (
        _black_bars(bright[:, inner].mean(axis=1)) or _other_bars(grey[:, inner].T) or (0, 0)
    )
    if top:
        bars += [
            np.array([0.0, 0.0, width, top]),
            np.array([0.0, height - bottom, width, height], float),
        ]
    return bars


def content_size(bars: Sequence[Float64Array], width: int, height: int) -> tuple[float, float]:
    """Return width and height, in pixels, of the content between the bars.

    :param bars: (4,) each, as `find_bars` returns them.
    :param width, height: of the whole picture in pixels.
    """
    sizes = np.array([bar[2:] - bar[:2] for bar in bars]).reshape(-1, 2)
    is_upright = sizes[:, 1] == height
    content_width = float(width - sizes[is_upright, 0].sum())
    return content_width, float(height - sizes[~is_upright, 1].sum())


def _black_bars(bright: FloatArray) -> tuple[int, int] | None:
    """Return the widths of black bars at both ends of n lines, from the share (n,) of bright pixels
    in each.
    """
    n = len(bright)
    picture = np.flatnonzero(bright > MAX_BRIGHT_SHARE)
    if not len(picture):
        return None
    begin = int(picture[0])
    end = n - 1 - int(picture[-1])
    edges = (
        bright[begin : begin + EDGE_PX].max(),
        bright[max(0, n - end - EDGE_PX) : n - end].max(),
    )
    if (
        min(edges) < MIN_EDGE_SHARE
        or min(begin, end) < MIN_WIDTH * n
        or abs(begin - end) > _tolerance(n)
    ):
        return None
    return begin, end


def _other_bars(grey: NDArray[Any]) -> tuple[int, int] | None:
    """Return the widths of bars of any kind on the left and right of a picture (rows, n)."""
    n = grey.shape[1]
    differences = cv2.absdiff(grey[:, 1:], grey[:, :-1])
    is_clear = (differences > MIN_STEP).mean(axis=0) >= MIN_STEP_SHARE
    faint = np.pad((differences > FAINT_STEP).mean(axis=0), 1)
    beside = np.maximum(faint[:-2], faint[2:])
    faint = faint[1:-1]
    is_faint = (faint >= FAINT_STEP_SHARE) & (beside <= FAINT_SHARE_BESIDE * faint)
    edges = np.flatnonzero(is_clear | is_faint) + 1
    begins = edges[edges < n / 2]
    ends = n - edges[edges > n / 2]
    is_pair = np.abs(begins[:, None] - ends) <= _tolerance(n)
    is_pair &= is_clear[begins - 1][:, None] | is_clear[n - ends - 1]
    pairs = [(int(begins[i]), int(ends[j])) for i, j in np.argwhere(is_pair)]
    pairs = [pair for pair in pairs if min(pair) >= max(MIN_WIDTH * n, 4) and n - sum(pair) > 4]
    if not pairs:
        return None
    line_detail = np.abs(cv2.Laplacian(np.ascontiguousarray(grey), cv2.CV_16S)).mean(axis=0)
    detail = np.concatenate([[0.0], np.cumsum(line_detail)])

    def mean(first: int, end: int) -> float:
        return float(detail[end] - detail[first]) / (end - first)

    # Each edge is two lines wide, which belong to neither side.
    for begin, end in sorted(pairs, reverse=True):
        outside = max(mean(0, begin - 2), mean(n - end + 2, n))
        if outside <= MAX_DETAIL * mean(begin + 2, n - end - 2):
            return begin, end
    return None


def _tolerance(n: int) -> float:
    return max(2.0, MAX_DIFFERENCE * n)
