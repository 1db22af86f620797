# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's box detector, used instead of BlazePose's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ......solver.errors import ModelFileError
from ...execution import Execution
from ...letterbox import fit_in
from ...person_detector import Detection
from ..description import Description, description_path, read_description
from ..graph import Graph
from .boxes import BORDER, BOX_FORMATS, DETECTIONS, Boxes, BoxFormat, suppress

DETECTOR_TYPES = tuple(each.type for each in BOX_FORMATS)
SCORE_THRESHOLD = 0.4


class BoxDetector:
    """Detects people in a whole image with the user's network; see `Description` for its JSON.

    :raises ModelFileError: the file or its JSON cannot be used, or the type of the network is unknown.
    """

    def __init__(self, path: Path, threads: int, execution: Execution | None = None) -> None:
        self._description = read_description(path, DETECTOR_TYPES)
        self._graph = Graph(path, self._description, threads, execution)
        self._format = _format_of(self._graph, self._description)
        self.type = self._format.type
        self._normalization = self._format.normalization.with_description(self._description)
        self._boxes(self._graph.trial_outputs)  # so that a missing class is reported now

    def detect(
        self, image_rgb: NDArray[np.uint8], threshold: float | None = None, closely: bool = False
    ) -> list[Detection]:
        """Detect all people in an (H, W, 3) uint8 RGB image, best first.

        :param threshold: least score; None for that of the JSON, or 0.4.
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
        kept = suppress(boxes, threshold or self._description.score_threshold or SCORE_THRESHOLD)
        corners = fitted.to_image(kept.corners.reshape(-1, 2, 2)).reshape(-1, 4)
        return [box_detection(float(s), box) for s, box in zip(kept.scores, corners, strict=True)]

    def detect_small(self, image_rgb: NDArray[np.uint8]) -> list[Detection]:
        """Return nothing for any (H, W, 3) image: how small people may be is a property of the user's network."""
        return []

    def detect_in_parts(self, image_rgb: NDArray[np.uint8]) -> list[Detection]:
        """Return nothing for any (H, W, 3) image, as `detect_small`."""
        return []

    def _boxes(self, outputs: list[NDArray[Any]]) -> Boxes:
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


def box_detection(score: float, box_px: NDArray[np.float64]) -> Detection:
    """Convert a box (4,) in pixels to a `Detection`: its centre as hips, a body circle as wide as its longer side."""
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
            'with {"type": "detections", "mean": 0, "std": 1, "channel_order": "bgr"} for YOLOX, with '
            '"mean": [103.53, 116.28, 123.675], "std": [57.375, 57.12, 58.395] for RTMDet'
        )
    return found
