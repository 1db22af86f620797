# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's box detector in the place of BlazePose's."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np

from ......solver.errors import ModelFileError
from ...execution import Execution
from ...person_detector import Detection
from ..description import Description, description_path, read_description
from ..graph import Graph
from . import detections, end_to_end, yolov4, yolov8, yolox
from .boxes import Boxes, letterbox, suppress

# In the order in which they are asked: YOLOX with one class also has rows of six.
_ADAPTERS: tuple[ModuleType, ...] = (yolox, yolov8, yolov4, end_to_end, detections)
DETECTOR_TYPES = tuple(adapter.TYPE for adapter in _ADAPTERS)
SCORE_THRESHOLD = 0.4


class BoxDetector:
    """Finds people in a whole image with a detector of the user's; see `Description` for the JSON beside it.

    :raises ModelFileError: the file or its JSON cannot be used, or does not tell what it is.
    """

    def __init__(self, path: Path, threads: int, execution: Execution | None = None) -> None:
        self._said = read_description(path, DETECTOR_TYPES)
        self._graph = Graph(path, self._said, threads, execution)
        self._adapter = _adapter_for(self._graph, self._said)
        self.type: str = self._adapter.TYPE
        self._normalization = self._adapter.NORMALIZATION.given(self._said)
        self._decode: Callable[..., Boxes] = self._adapter.decode
        if self._adapter is yolox:
            decoded = yolox.is_decoded(self._graph) if self._said.decoded is None else self._said.decoded
            self._decode = partial(yolox.decode, decoded=decoded)
        self._boxes(self._graph.trial)  # so that a class that is not there is told now

    def detect(self, image_rgb: np.ndarray, threshold: float | None = None, closely: bool = False) -> list[Detection]:
        """All people in an (H, W, 3) uint8 image, best first; ``closely`` changes nothing."""
        look = letterbox(
            image_rgb,
            self._graph.width,
            self._graph.height,
            centered=self._adapter.CENTERED,
            stretched=self._adapter.STRETCHED,
        )
        boxes = self._boxes(self._graph.run(look.picture_rgb, self._normalization))
        kept = suppress(boxes, threshold or self._said.score_threshold or SCORE_THRESHOLD)
        corners = look.to_image(kept.corners.reshape(-1, 2, 2)).reshape(-1, 4)
        return [box_detection(float(s), box) for s, box in zip(kept.scores, corners, strict=True)]

    def _boxes(self, outputs: list[np.ndarray]) -> Boxes:
        try:
            boxes = self._decode(outputs, self._graph, self._said)
            if boxes.corners.shape != (*boxes.scores.shape, 4):
                raise ValueError("as many boxes as scores are needed")
            return boxes
        except (IndexError, ValueError) as error:
            raise ModelFileError(
                f"{self._graph.path} does not give what a {self.type} detector with class {self._said.person_class} "
                f"gives, but arrays of {[o.shape for o in outputs]}; correct {description_path(self._graph.path)}"
            ) from error


def box_detection(score: float, box_px: np.ndarray) -> Detection:
    """A box as the tracker wants a person: the middle as hips, a circle as wide as the longer side."""
    center = (box_px[:2] + box_px[2:]) / 2
    top = center - [0.0, float((box_px[2:] - box_px[:2]).max()) / 2]
    return Detection(score, box_px, np.stack([center, top, center, top]))


def _adapter_for(graph: Graph, said: Description) -> ModuleType:
    adapter = next((a for a in _ADAPTERS if a.TYPE == said.type), None)
    adapter = adapter or next((a for a in _ADAPTERS if a.recognises(graph)), None)
    if adapter is None:
        raise graph.unrecognised("a detector", DETECTOR_TYPES)
    if adapter is detections and (said.mean is None or said.channel_order is None):
        raise ModelFileError(
            f"{graph.path} is MMDeploy's, but not how its colours are normalised; write {description_path(graph.path)} "
            'with {"type": "detections", "mean": 0, "std": 1, "channel_order": "bgr"} for YOLOX, with '
            '"mean": [103.53, 116.28, 123.675], "std": [57.375, 57.12, 58.395] for RTMDet'
        )
    return adapter
