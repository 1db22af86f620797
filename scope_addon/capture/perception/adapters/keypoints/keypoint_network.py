# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's top-down keypoint network, with the interface of BlazePose's landmark network for the tracker.

Its input is a box around the person, rotated so that the trunk is upright. It does not estimate depth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ......solver.errors import ModelFileError
from ...execution import Execution
from ...landmark_network import KEYPOINT_NAMES, PoseEstimate
from ...region import Region, box_along
from ..description import Description, description_path, read_description
from ..graph import IMAGENET, Graph
from ..keypoint_sets import COCO_17, KEYPOINT_SETS, KeypointSet
from .keypoint_formats import KEYPOINT_FORMATS, KeypointFormat

KEYPOINT_TYPES = tuple(each.type for each in KEYPOINT_FORMATS)
SCORE_THRESHOLD = 0.3  # from which a keypoint counts as seen
UNSURE = 0.25  # share of this threshold from which a keypoint widens the next region
MARGIN = 1.4  # the keypoints' box lacks crown, feet and the border that these networks are trained with
MIN_STATURE = 1.6  # least side in lengths of trunk and leg: a person who crouches will stand up
MAX_SHRINK = 0.97  # from one frame to the next: legs that are briefly occluded must stay inside
MIN_KEYPOINTS = 4  # to predict the next region
_BODY = np.array([KEYPOINT_NAMES.index(name) for name in COCO_17])
_SHOULDERS = np.array([KEYPOINT_NAMES.index(f"{side}_shoulder") for side in ("left", "right")])
_HIPS = np.array([KEYPOINT_NAMES.index(f"{side}_hip") for side in ("left", "right")])
_LEGS = [[KEYPOINT_NAMES.index(f"{side}_{joint}") for joint in ("hip", "knee", "ankle")] for side in ("left", "right")]


class KeypointNetwork:
    """The user's network; see `Description` for its JSON.

    :raises ModelFileError: the file or its JSON cannot be used, or the type of the network is unknown.
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
        self._corner = np.array([(self._side - self._graph.width) // 2, (self._side - self._graph.height) // 2])

    def estimate(self, image_rgb: NDArray[np.uint8], regions: Sequence[Region]) -> list[PoseEstimate]:
        """Estimate one pose per region of an (H, W, 3) uint8 RGB image; world landmarks are all 0, that is, unknown.

        :raises ModelFileError: the network fails.
        """
        return [self._estimate(image_rgb, region) for region in regions]

    def _estimate(self, image_rgb: NDArray[np.uint8], region: Region) -> PoseEstimate:
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

    def _next_region(self, points: NDArray[np.float64], confidence: NDArray[np.float64], region: Region) -> Region:
        """Calculate the box around the seen keypoints, upright along the trunk, in the network's aspect ratio."""
        seen = confidence >= UNSURE * self._threshold
        if seen.sum() < MIN_KEYPOINTS:
            return region
        trunk = points[_SHOULDERS].mean(axis=0) - points[_HIPS].mean(axis=0)
        upright = math.atan2(float(trunk[0]), float(-trunk[1]))
        rotation = upright if seen[[*_SHOULDERS, *_HIPS]].all() else region.rotation
        (x, y), sides = box_along(points[seen], rotation)
        shape = np.array([self._graph.width, self._graph.height]) / self._side
        around = MARGIN * float((sides / shape).max())
        side = max(around, MAX_SHRINK * region.side_px, MIN_STATURE * _stature(points, seen))
        return Region((float(x), float(y)), side, rotation)


def _stature(points: NDArray[np.float64], seen: NDArray[np.bool_]) -> float:
    """Add the lengths in pixels of trunk, thigh and lower leg, regardless of the pose; 0 for those not seen."""
    ends = [points[pair].mean(axis=0) for pair in (_SHOULDERS, _HIPS)]
    trunk = math.dist(*ends) if seen[[*_SHOULDERS, *_HIPS]].all() else 0.0
    legs = [
        sum(math.dist(points[a], points[b]) for a, b in zip(leg, leg[1:], strict=False)) if seen[leg].all() else 0.0
        for leg in _LEGS
    ]
    return trunk + max(legs)


def _format_of(graph: Graph, description: Description) -> KeypointFormat:
    found = next((f for f in KEYPOINT_FORMATS if f.matches(graph) and description.type in (None, f.type)), None)
    if found is None:
        why = f"it is not {description.type}" if description.type else "its outputs match no known type"
        raise graph.unrecognized("a keypoint network", KEYPOINT_TYPES, why)
    return found


def _set_for(graph: Graph, description: Description) -> KeypointSet:
    count = graph.shapes[0][1]
    of_count = next((s for s in KEYPOINT_SETS.values() if s.count == count), None)
    found = KEYPOINT_SETS[description.keypoints] if description.keypoints else of_count
    if found is None or found.count > count:
        sets = ", ".join(f"{s.name} ({s.count})" for s in KEYPOINT_SETS.values())
        raise ModelFileError(
            f"{graph.path} outputs {count} keypoints, which matches none of {sets}; if it begins with those of "
            f'one of these, name it in {description_path(graph.path)}: {{"keypoints": "coco17"}}'
        )
    return found
