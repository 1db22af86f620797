# SPDX-License-Identifier: GPL-3.0-or-later
"""Keypoints from the outputs of networks: heatmaps, and SimCC.

Heatmaps (HRNet, ViTPose, AlphaPose): (1, J, rows, columns), coarser than the input, with a maximum at each keypoint.
The maximum is refined by a quarter of a cell towards its greater neighbours, or by DARK: with h the logarithm of the
heatmap after a Gaussian blur, the maximum of its second-order Taylor expansion about the greatest cell is at

    cell − (∇²h)⁻¹ ∇h

(Zhang et al., Distribution-Aware Coordinate Representation for Human Pose Estimation, CVPR 2020). A cell c is the pixel
c · width / columns, or with ``udp`` c · (width − 1) / (columns − 1).

SimCC (RTMPose, RTMW): two rows of scores per keypoint, along x and along y, in bins of a fraction of a pixel:
``simcc_x`` (1, J, ratio · width), ``simcc_y`` (1, J, ratio · height); pixel = argmax / ratio, the score is the smaller
of the two maxima. The ratio, mostly 2, follows from the sizes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ..description import Description
from ..graph import Graph, finite

_BLUR = 11  # cells; suits the Gaussians of 2 to 3 cells that these networks are trained with
_MIN_HEAT = 1e-10

Outputs = list[NDArray[Any]]
Keypoints = tuple[NDArray[np.float64], NDArray[np.float64]]
"""(J, 2) pixels of the network's input, the top left pixel's centre at 0, and (J,) scores."""


class KeypointFormat(NamedTuple):
    """A kind of graph: ``matches`` recognizes it by its outputs, ``decode`` locates the keypoints in these."""

    type: str
    matches: Callable[[Graph], bool]
    decode: Callable[[Outputs, Graph, Description], Keypoints]


def _is_heatmap(graph: Graph) -> bool:
    """Check for one output, with a map per keypoint that is not finer than the input."""
    if len(graph.shapes) != 1 or len(graph.shapes[0]) != 4:
        return False
    _, _, rows, columns = graph.shapes[0]
    return 8 <= rows <= graph.height and 8 <= columns <= graph.width


def _heatmap(outputs: Outputs, graph: Graph, description: Description) -> Keypoints:
    heatmaps = finite(outputs[0])[0]
    count, rows, columns = heatmaps.shape
    greatest = heatmaps.reshape(count, -1).argmax(axis=1)
    cells = np.stack([greatest % columns, greatest // columns], axis=1)
    scores: NDArray[np.float64] = heatmaps.reshape(count, -1).max(axis=1)
    refine = _by_taylor if description.decode == "dark" else _by_quarter
    refined: NDArray[np.float64] = np.array(
        [refine(h, x, y) for h, (x, y) in zip(heatmaps, cells.tolist(), strict=True)]
    )
    size, grid = np.array([graph.width, graph.height]), np.array([columns, rows])
    pixels_per_cell: NDArray[np.float64] = (size - 1) / (grid - 1) if description.udp else size / grid
    return refined * pixels_per_cell, scores


def _by_quarter(heat: NDArray[np.float64], x: int, y: int) -> tuple[float, float]:
    """Move a quarter of a cell towards the greater neighbour, in x and in y."""
    rows, columns = heat.shape
    if not (0 < x < columns - 1 and 0 < y < rows - 1):
        return x, y
    right, down = heat[y, x + 1] - heat[y, x - 1], heat[y + 1, x] - heat[y - 1, x]
    return x + 0.25 * float(np.sign(right)), y + 0.25 * float(np.sign(down))


def _by_taylor(heat: NDArray[np.float64], x: int, y: int) -> tuple[float, float]:
    """Refine by DARK; keep the cell itself at the edge and where the expansion has no maximum."""
    rows, columns = heat.shape
    if not (1 < x < columns - 2 and 1 < y < rows - 2) or heat[y, x] <= 0:
        return x, y
    reach = _BLUR // 2 + 2  # the support of the blur in the 5 x 5 cells that are used
    left, top = max(0, x - reach), max(0, y - reach)
    part = heat[top : y + reach + 1, left : x + reach + 1]
    # zero padding: there is no heat beyond the heatmap
    blurred = cv2.GaussianBlur(part, (_BLUR, _BLUR), 0, borderType=cv2.BORDER_CONSTANT)
    h = np.log(np.maximum(blurred, _MIN_HEAT))
    x0, y0 = x - left, y - top
    gradient = np.array([h[y0, x0 + 1] - h[y0, x0 - 1], h[y0 + 1, x0] - h[y0 - 1, x0]]) / 2
    xx = (h[y0, x0 + 2] - 2 * h[y0, x0] + h[y0, x0 - 2]) / 4
    yy = (h[y0 + 2, x0] - 2 * h[y0, x0] + h[y0 - 2, x0]) / 4
    xy = (h[y0 + 1, x0 + 1] - h[y0 - 1, x0 + 1] - h[y0 + 1, x0 - 1] + h[y0 - 1, x0 - 1]) / 4
    if xx >= 0 or xx * yy - xy * xy <= 1e-12:
        return x, y
    step = -np.linalg.solve(np.array([[xx, xy], [xy, yy]]), gradient)
    step = np.clip(step, -1.0, 1.0)
    return x + float(step[0]), y + float(step[1])


def _simcc(outputs: Outputs, graph: Graph, description: Description) -> Keypoints:
    axes = _axes(graph)
    assert axes is not None
    along_x, along_y = (finite(outputs[k])[0] for k in axes)
    ratio = along_x.shape[1] / graph.width
    points = np.stack([along_x.argmax(axis=1), along_y.argmax(axis=1)], axis=1) / ratio
    return points, np.minimum(along_x.max(axis=1), along_y.max(axis=1))


def _axes(graph: Graph) -> tuple[int, int] | None:
    """Find the indices of the outputs along x and along y; None if there are none."""
    shapes = graph.shapes
    if len(shapes) != 2 or any(len(s) != 3 for s in shapes) or shapes[0][:2] != shapes[1][:2]:
        return None
    orders = [(0, 1), (1, 0)]
    if graph.names[0].lower().endswith("y"):
        orders.reverse()
    for x, y in orders:
        ratio = shapes[x][2] / graph.width
        if ratio >= 1 and abs(shapes[y][2] - ratio * graph.height) < 1:
            return x, y
    return None


KEYPOINT_FORMATS = (
    KeypointFormat("simcc", lambda graph: _axes(graph) is not None, _simcc),
    KeypointFormat("heatmap", _is_heatmap, _heatmap),
)
