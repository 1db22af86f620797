# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's box detector, used instead of BlazePose's: how each kind of graph is read, and
non-maximum suppression.

Positions in the network's input are measured from its left and top edges, as detectors do;
positions in the image from the centre of the top left pixel, as OpenCV does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .....solver.errors import ModelFileError
from ....arrays import Float64Array, Uint8Array
from ..person_detector import Detection, Search, overlap_clusters
from ..region import fit_in
from ..sessions import Execution
from .description import Description, description_path, read_description
from .graph import PIXELS_BGR, UNIT, Graph, Normalization, Outputs, finite

SCORE_THRESHOLD = 0.4
BORDER = 114  # the grey level that the YOLO family is trained with
OVERLAP_THRESHOLD = 0.5
MAX_BOXES = 5000  # the best ones are compared with each other; a broken network may output millions
_CELL_SIDES = (8, 16, 32)  # pixels
_LARGEST_LOGARITHM = 10.0


@dataclass(frozen=True)
class Boxes:
    """Boxes: ``corners`` (N, 4) left, top, right, bottom in pixels of the network's input;
    ``scores`` (N,) 0..1.
    """

    corners: Float64Array
    scores: Float64Array


class BoxFormat(NamedTuple):
    """A kind of graph: ``matches`` recognizes it by its outputs, ``decode`` reads the boxes of
    people from these.
    """

    type: str
    normalization: Normalization
    matches: Callable[[Graph], bool]
    decode: Callable[[Outputs, Graph, Description], Boxes]
    # The image lies in the middle of the input rather than in its top left corner.
    centered: bool = False
    stretched: bool = False  # to the input, regardless of the image's aspect ratio


def _corners_of(centers_and_sizes: Float64Array) -> Float64Array:
    """Convert (N, 4) centre x, y, width, height to left, top, right, bottom."""
    center = centers_and_sizes[:, :2]
    half = centers_and_sizes[:, 2:4] / 2
    return np.concatenate([center - half, center + half], axis=1)


def suppress(boxes: Boxes, threshold: float) -> Boxes:
    """Apply non-maximum suppression.

    :return: the remaining boxes, best first; none overlaps a better one by more than half.
    """
    size = boxes.corners[:, 2:] - boxes.corners[:, :2]
    chosen = np.flatnonzero((boxes.scores >= threshold) & (size > 0).all(axis=1))
    order = chosen[np.argsort(-boxes.scores[chosen], kind="stable")][:MAX_BOXES]
    kept = order[
        [cluster[0] for cluster in overlap_clusters(boxes.corners[order], OVERLAP_THRESHOLD)]
    ]
    return Boxes(boxes.corners[kept], boxes.scores[kept])


# YOLOX: one output (1, cells, 5 + classes), a row per cell of the grids of 8, 16 and 32 pixels. A
# row is x, y, width, height, the probability of an object and one for each class; a score is the
# product of the two. If undecoded, x and y are relative to the cell in units of its side, and width
# and height are logarithms:
#
#     x = (x_raw + column) · side,  width = exp(width_raw) · side


def _is_yolox(graph: Graph) -> bool:
    rows, columns = _table_of(graph)
    return rows == len(cells(graph.width, graph.height)) and columns >= 6


def _table_of(graph: Graph) -> tuple[int, int]:
    """Return the rows and columns of the only output; zeros if it is no table."""
    if len(graph.shapes) != 1 or len(graph.shapes[0]) != 3:
        return 0, 0
    _, rows, columns = graph.shapes[0]
    return rows, columns


def _yolox(outputs: Outputs, graph: Graph, description: Description) -> Boxes:
    rows = finite(outputs[0])[0]
    box = rows[:, :4]
    decoded = description.decoded
    if decoded is None:  # boxes in pixels spread over the whole input, others over a few units
        decoded = bool(np.abs(finite(graph.trial_outputs[0][0, :, 0])).mean() > graph.width / 8)
    if not decoded:
        grid = cells(graph.width, graph.height)
        center = (box[:, :2] + grid[:, :2]) * grid[:, 2:]
        box = np.concatenate(
            [center, np.exp(np.minimum(box[:, 2:], _LARGEST_LOGARITHM)) * grid[:, 2:]], axis=1
        )
    return Boxes(_corners_of(box), rows[:, 4] * rows[:, 5 + description.person_class])


def cells(width: int, height: int) -> Float64Array:
    """List column, row and side in pixels (N, 3) of every cell in the order of the rows."""
    grids = []
    for side in _CELL_SIDES:
        row, column = np.meshgrid(
            np.arange(height // side), np.arange(width // side), indexing="ij"
        )
        grids.append(np.stack([column, row, np.full(column.shape, side)], axis=-1).reshape(-1, 3))
    return np.concatenate(grids).astype(np.float64)


# YOLOv8, YOLO11 and similar: one output (1, 4 + classes, cells), a column per box: its centre x, y,
# width and height, and a score for each class. Rows after the classes (the keypoints of a pose
# network) are ignored.


def _is_yolov8(graph: Graph) -> bool:
    numbers, boxes = _table_of(graph)
    return numbers >= 5 and boxes == len(cells(graph.width, graph.height))


def _yolov8(outputs: Outputs, graph: Graph, description: Description) -> Boxes:
    columns = finite(outputs[0])[0]
    return Boxes(_corners_of(columns[:4].T), columns[4 + description.person_class])


# YOLOv4 and similar: ``boxes`` (1, N, 1, 4) and ``confs`` (1, N, classes), in either order. A box
# is left, top, right, bottom as fractions of the input; a score is that of the class.


def _is_yolov4(graph: Graph) -> bool:
    if len(graph.shapes) != 2:
        return False
    boxes, scores = graph.shapes if _boxes_first(graph.shapes) else graph.shapes[::-1]
    return _is_boxes(boxes) and len(scores) == 3 and scores[1] == boxes[1]


def _yolov4(outputs: Outputs, graph: Graph, description: Description) -> Boxes:
    boxes, scores = outputs if _boxes_first([o.shape for o in outputs]) else outputs[::-1]
    size = np.array([graph.width, graph.height] * 2, float)
    return Boxes(
        finite(boxes).reshape(-1, 4) * size, finite(scores)[0, :, description.person_class]
    )


def _boxes_first(shapes: list[tuple[int, ...]]) -> bool:
    return not _is_boxes(shapes[1]) or _is_boxes(shapes[0])


def _is_boxes(shape: tuple[int, ...]) -> bool:
    return len(shape) == 4 and shape[2:] == (1, 4)


# Detectors with non-maximum suppression inside the graph (YOLOv10, YOLO26, ``nms=True``): one
# output (1, N, 6), N mostly 300. A row is left, top, right, bottom, score and index of the class.


def _is_end_to_end(graph: Graph) -> bool:
    return _table_of(graph)[1] == 6


def _end_to_end(outputs: Outputs, graph: Graph, description: Description) -> Boxes:
    rows = finite(outputs[0])[0]
    rows = rows[np.round(rows[:, 5]) == description.person_class]
    return Boxes(rows[:, :4], rows[:, 4])


# MMDeploy's detectors, also with non-maximum suppression inside: ``dets`` (1, N, 5) and ``labels``
# (1, N). A row is left, top, right, bottom and score. Several families of networks are exported
# with these outputs, each with its own normalization, which their JSON has to specify.


def _is_detections(graph: Graph) -> bool:
    if len(graph.shapes) != 2:
        return False
    rows, labels = graph.shapes
    return len(rows) == 3 and rows[2] == 5 and labels == rows[:2]


def _detections(outputs: Outputs, graph: Graph, description: Description) -> Boxes:
    people = outputs[1][0] == description.person_class
    rows = finite(outputs[0])[0][people]
    return Boxes(rows[:, :4], rows[:, 4])


DETECTIONS = BoxFormat("detections", PIXELS_BGR, _is_detections, _detections)
# In the order in which they are matched: YOLOX with one class also has rows of six.
BOX_FORMATS = (
    BoxFormat("yolox", PIXELS_BGR, _is_yolox, _yolox),
    BoxFormat("yolov8", UNIT, _is_yolov8, _yolov8, centered=True),
    BoxFormat("yolov4", UNIT, _is_yolov4, _yolov4, stretched=True),
    BoxFormat("end_to_end", UNIT, _is_end_to_end, _end_to_end, centered=True),
    DETECTIONS,
)
DETECTOR_TYPES = tuple(each.type for each in BOX_FORMATS)


class BoxDetector:
    """Detects people in a whole image with the user's network; see `Description` for its JSON.

    :raises ModelFileError: the file or its JSON cannot be used, or the type of the network is
        unknown.
    """

    def __init__(self, path: Path, threads: int, execution: Execution | None = None) -> None:
        self._description = read_description(path, DETECTOR_TYPES)
        self._graph = Graph(path, self._description, threads, execution)
        self._format = _format_of(self._graph, self._description)
        self.type = self._format.type
        self._normalization = self._format.normalization.with_description(self._description)
        self._boxes(self._graph.trial_outputs)  # so that a missing class is reported now

    def detect(self, image_rgb: Uint8Array, closely: bool = False) -> list[Detection]:
        """Detect all people in an (H, W, 3) uint8 RGB image, best first.

        :param closely: unused, see `PersonDetector.detect`.
        :raises ModelFileError: the network fails.
        """
        fitted = fit_in(
            image_rgb,
            self._graph.width,
            self._graph.height,
            border=BORDER,
            centered=self._format.centered,
            stretched=self._format.stretched,
        )
        boxes = self._boxes(self._graph.run(fitted.picture_rgb, self._normalization))
        kept = suppress(boxes, self._description.score_threshold or SCORE_THRESHOLD)
        corners = fitted.to_image(kept.corners.reshape(-1, 2, 2)).reshape(-1, 4)
        return [box_detection(float(s), box) for s, box in zip(kept.scores, corners, strict=True)]

    def detect_smaller(self, image_rgb: Uint8Array, search: Search) -> list[Detection]:
        """Return nothing for any (H, W, 3) image: how small people may be is a property of the
        user's network.
        """
        return []

    def detect_turned(self, image_rgb: Uint8Array) -> list[Detection]:
        """Detect people who are not upright in an (H, W, 3) uint8 RGB image.

        A box does not say which way up a person is, and many networks miss people who are upside
        down. Searches the image in the three other quarter turns.
        """
        height, width = image_rgb.shape[:2]
        found = []
        for quarter_turns in (1, 2, 3):
            turned_rgb = np.ascontiguousarray(np.rot90(image_rgb, quarter_turns))
            for detection in self.detect(turned_rgb):
                found.append(detection.turned_back(quarter_turns, width, height))
        return found

    def _boxes(self, outputs: Outputs) -> Boxes:
        try:
            boxes = self._format.decode(outputs, self._graph, self._description)
            if boxes.corners.shape != (*boxes.scores.shape, 4):
                raise ValueError("the numbers of boxes and scores differ")
            return boxes
        except (IndexError, ValueError) as error:
            raise ModelFileError(
                f"{self._graph.path} outputs arrays of {[o.shape for o in outputs]}, which do not "
                f"match a {self.type} detector with class {self._description.person_class}; "
                f"correct {description_path(self._graph.path)}"
            ) from error


def box_detection(score: float, box_px: Float64Array) -> Detection:
    """Convert a box (4,) in pixels to a `Detection`: its centre as hips, a body circle as wide as
    its longer side.
    """
    center = (box_px[:2] + box_px[2:]) / 2
    top = center - [0.0, float((box_px[2:] - box_px[:2]).max()) / 2]
    return Detection(score, box_px, np.stack([center, top, center, top]))


def _format_of(graph: Graph, description: Description) -> BoxFormat:
    found = next((each for each in BOX_FORMATS if each.type == description.type), None)
    found = found or next((each for each in BOX_FORMATS if each.matches(graph)), None)
    if found is None:
        raise graph.unrecognized("a detector", DETECTOR_TYPES)
    if found is DETECTIONS and (description.mean is None or description.channel_order is None):
        raise ModelFileError(
            f"{graph.path} is an MMDeploy model, but its colour normalization is unknown; create "
            f"{description_path(graph.path)} "
            'with {"type": "detections", "mean": 0, "std": 1, "channel_order": "bgr"} for YOLOX, '
            "with "
            '"mean": [103.53, 116.28, 123.675], "std": [57.375, 57.12, 58.395] for RTMDet'
        )
    return found
