# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's top-down keypoint network, with the interface of BlazePose's landmark network for the
tracker.

Its input is a box around the person, rotated so that the trunk is upright. It does not estimate
depth. Its outputs are heatmaps or SimCC.

Heatmaps (HRNet, ViTPose, AlphaPose): (1, J, rows, columns), coarser than the input, with a maximum
at each keypoint. The maximum is refined by a quarter of a cell towards its greater neighbours, or
by DARK: with h the logarithm of the heatmap after a Gaussian blur, the maximum of its second-order
Taylor expansion about the greatest cell is at

    cell − (∇²h)⁻¹ ∇h

(Zhang et al., Distribution-Aware Coordinate Representation for Human Pose Estimation, CVPR 2020). A
cell c is the pixel c · width / columns, or with ``udp`` c · (width − 1) / (columns − 1).

SimCC (RTMPose, RTMW): two rows of scores per keypoint, along x and along y, in bins of a fraction
of a pixel: ``simcc_x`` (1, J, ratio · width), ``simcc_y`` (1, J, ratio · height); pixel = argmax /
ratio, the score is the smaller of the two maxima. The ratio, mostly 2, follows from the sizes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from .....solver.errors import ModelFileError
from ....arrays import BoolArray, Float64Array, Uint8Array
from ..landmark_network import HIPS, KEYPOINT_NAMES, LEGS, SHOULDERS, TRUNK, PoseEstimate
from ..region import Region, box_along, rotation_towards
from ..sessions import Execution
from .description import (
    COCO_17,
    KEYPOINT_SETS,
    Description,
    KeypointSet,
    description_path,
    read_description,
)
from .graph import IMAGENET, Graph, Outputs, finite

SCORE_THRESHOLD = 0.3  # from which a keypoint counts as seen
UNSURE = 0.25  # share of this threshold from which a keypoint widens the next region
# The box of the keypoints lacks crown, feet and the border that these networks are trained with.
MARGIN = 1.4
MIN_STATURE = 1.6  # least side in lengths of trunk and leg: a person who crouches will stand up
MAX_SHRINK = 0.97  # from one frame to the next: legs that are briefly occluded must stay inside
MIN_KEYPOINTS = 4  # to predict the next region
_BODY = np.array([KEYPOINT_NAMES.index(name) for name in COCO_17])
_BLUR = 11  # cells; suits the Gaussians of 2 to 3 cells that these networks are trained with
_MIN_HEAT = 1e-10

Keypoints = tuple[Float64Array, Float64Array]
"""(J, 2) pixels of the network's input, the top left pixel's centre at 0, and (J,) scores."""


class KeypointFormat(NamedTuple):
    """A kind of graph: ``matches`` recognizes it by its outputs, ``decode`` locates the keypoints
    in these.
    """

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
    scores: Float64Array = heatmaps.reshape(count, -1).max(axis=1)
    refine = _by_taylor if description.decode == "dark" else _by_quarter
    refined: Float64Array = np.array(
        [refine(h, x, y) for h, (x, y) in zip(heatmaps, cells.tolist(), strict=True)]
    )
    size = np.array([graph.width, graph.height])
    grid = np.array([columns, rows])
    pixels_per_cell: Float64Array = (size - 1) / (grid - 1) if description.udp else size / grid
    return refined * pixels_per_cell, scores


def _by_quarter(heat: Float64Array, x: int, y: int) -> tuple[float, float]:
    """Move a quarter of a cell towards the greater neighbour, in x and in y."""
    rows, columns = heat.shape
    if not (0 < x < columns - 1 and 0 < y < rows - 1):
        return x, y
    right = heat[y, x + 1] - heat[y, x - 1]
    down = heat[y + 1, x] - heat[y - 1, x]
    return x + 0.25 * float(np.sign(right)), y + 0.25 * float(np.sign(down))


def _by_taylor(heat: Float64Array, x: int, y: int) -> tuple[float, float]:
    """Refine by DARK; keep the cell itself at the edge and where the expansion has no maximum."""
    rows, columns = heat.shape
    if not (1 < x < columns - 2 and 1 < y < rows - 2) or heat[y, x] <= 0:
        return x, y
    reach = _BLUR // 2 + 2  # the support of the blur in the 5 x 5 cells that are used
    left = max(0, x - reach)
    top = max(0, y - reach)
    part = heat[top : y + reach + 1, left : x + reach + 1]
    # Zero padding: there is no heat beyond the heatmap.
    blurred = cv2.GaussianBlur(part, (_BLUR, _BLUR), 0, borderType=cv2.BORDER_CONSTANT)
    h = np.log(np.maximum(blurred, _MIN_HEAT))
    x0 = x - left
    y0 = y - top
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
KEYPOINT_TYPES = tuple(each.type for each in KEYPOINT_FORMATS)


class KeypointNetwork:
    """The user's network; see `Description` for its JSON.

    :raises ModelFileError: the file or its JSON cannot be used, or the type of the network is
        unknown.
    """

    def __init__(self, path: Path, threads: int, execution: Execution | None = None) -> None:
        self._description = description = read_description(path, KEYPOINT_TYPES)
        self._graph = Graph(path, description, threads, execution)
        self._format = _format_of(self._graph, description)
        self.type = self._format.type
        self.keypoint_set = _set_for(self._graph, description)
        self._normalization = IMAGENET.with_description(description)
        self._threshold = description.score_threshold or SCORE_THRESHOLD
        self._side = max(self._graph.width, self._graph.height)
        self._corner = np.array(
            [(self._side - self._graph.width) // 2, (self._side - self._graph.height) // 2]
        )

    def estimate(self, image_rgb: Uint8Array, regions: Sequence[Region]) -> list[PoseEstimate]:
        """Estimate one pose per region of an (H, W, 3) uint8 RGB image; world landmarks are all 0,
        that is, unknown.

        :raises ModelFileError: the network fails.
        """
        return [self._estimate(image_rgb, region) for region in regions]

    def _estimate(self, image_rgb: Uint8Array, region: Region) -> PoseEstimate:
        left, top = self._corner
        square = region.cut(image_rgb, self._side)
        picture = square[top : top + self._graph.height, left : left + self._graph.width]
        outputs = self._graph.run(picture, self._normalization)
        points, scores = self._format.decode(outputs, self._graph, self._description)
        pixels = region.image_from_crop((points + self._corner + 0.5) / self._side)
        ours, confidence = self.keypoint_set.to_blazepose(pixels, np.clip(scores, 0.0, 1.0))
        height, width = image_rgb.shape[:2]
        in_frame = ((ours >= -0.5) & (ours <= [width - 0.5, height - 0.5])).all(axis=1)
        return PoseEstimate(
            keypoints_px=ours,
            keypoints_confidence=confidence * in_frame,
            world_landmarks=np.zeros((len(KEYPOINT_NAMES), 3)),
            presence=float((confidence[_BODY] >= self._threshold).mean()),
            region=region,
            next_region=self._next_region(ours, confidence, region),
        )

    def _next_region(
        self, points: Float64Array, confidence: Float64Array, region: Region
    ) -> Region:
        """Calculate the box around the seen keypoints, upright along the trunk, in the network's
        aspect ratio.
        """
        seen = confidence >= UNSURE * self._threshold
        if seen.sum() < MIN_KEYPOINTS:
            return region
        trunk = points[SHOULDERS].mean(axis=0) - points[HIPS].mean(axis=0)
        rotation = rotation_towards(trunk) if seen[TRUNK].all() else region.rotation
        (x, y), sides = box_along(points[seen], rotation)
        shape = np.array([self._graph.width, self._graph.height]) / self._side
        around = MARGIN * float((sides / shape).max())
        side = max(around, MAX_SHRINK * region.side_px, MIN_STATURE * _stature(points, seen))
        return Region((x, y), side, rotation)


def _stature(points: Float64Array, seen: BoolArray) -> float:
    """Add the lengths in pixels of trunk, thigh and lower leg, regardless of the pose; 0 for those
    not seen.
    """
    ends = [points[pair].mean(axis=0) for pair in (SHOULDERS, HIPS)]
    trunk = math.dist(*ends) if seen[TRUNK].all() else 0.0
    legs = [
        sum(math.dist(points[a], points[b]) for a, b in zip(leg, leg[1:], strict=False))
        if seen[leg].all()
        else 0.0
        for leg in LEGS
    ]
    return trunk + max(legs)


def _format_of(graph: Graph, description: Description) -> KeypointFormat:
    found = next(
        (f for f in KEYPOINT_FORMATS if f.matches(graph) and description.type in (None, f.type)),
        None,
    )
    if found is None:
        why = (
            f"it is not {description.type}"
            if description.type
            else "its outputs match no known type"
        )
        raise graph.unrecognized("a keypoint network", KEYPOINT_TYPES, why)
    return found


def _set_for(graph: Graph, description: Description) -> KeypointSet:
    count = graph.shapes[0][1]
    of_count = next((s for s in KEYPOINT_SETS.values() if s.count == count), None)
    found = KEYPOINT_SETS[description.keypoints] if description.keypoints else of_count
    if found is None or found.count > count:
        sets = ", ".join(f"{s.name} ({s.count})" for s in KEYPOINT_SETS.values())
        raise ModelFileError(
            f"{graph.path} outputs {count} keypoints, which matches none of {sets}; if it begins "
            "with those of "
            f'one of these, name it in {description_path(graph.path)}: {{"keypoints": "coco17"}}'
        )
    return found
