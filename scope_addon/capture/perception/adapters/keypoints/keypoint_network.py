# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's top-down keypoint network in the place of BlazePose's landmark network: the same interface for the tracker.

It looks at a box about the person, turned so that the trunk is upright, and tells nothing about depth.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np

from ......solver.errors import ModelFileError
from ...execution import Execution
from ...landmark_network import KEYPOINT_NAMES, PoseEstimate
from ...region import Region
from ..description import Description, description_path, read_description
from ..graph import Graph
from ..keypoint_sets import COCO_17, KEYPOINT_SETS, KeypointSet, keypoint_set_of_count
from . import heatmap, simcc

_ADAPTERS: tuple[ModuleType, ...] = (simcc, heatmap)
KEYPOINT_TYPES = tuple(adapter.TYPE for adapter in _ADAPTERS)
SCORE_THRESHOLD = 0.3  # from which a keypoint counts as seen
UNSURE = 0.25  # of this threshold: enough to widen the next region
MARGIN = 1.4  # the box round the keypoints lacks crown, feet and the border that these networks are trained with
STATURE = 1.6  # the least, in lengths of trunk and leg: a person who crouches will stand up
SHRINKS = 0.97  # the most from one frame to the next: legs that were hidden for a moment must stay inside
FEWEST = 4  # keypoints that say where to look next
_BODY = np.array([KEYPOINT_NAMES.index(name) for name in COCO_17])
_SHOULDERS = np.array([KEYPOINT_NAMES.index(f"{side}_shoulder") for side in ("left", "right")])
_HIPS = np.array([KEYPOINT_NAMES.index(f"{side}_hip") for side in ("left", "right")])
_LEGS = [[KEYPOINT_NAMES.index(f"{side}_{joint}") for joint in ("hip", "knee", "ankle")] for side in ("left", "right")]

Decode = Callable[[list[np.ndarray], Graph], tuple[np.ndarray, np.ndarray]]


class KeypointNetwork:
    """See `Description` for the JSON beside the model.

    :raises ModelFileError: the file or its JSON cannot be used, or does not tell what it is.
    """

    def __init__(self, path: Path, threads: int, execution: Execution | None = None) -> None:
        said = read_description(path, KEYPOINT_TYPES)
        self._graph = Graph(path, said, threads, execution)
        self._adapter = _adapter_for(self._graph, said)
        self.type: str = self._adapter.TYPE
        self.keypoint_set = _set_for(self._graph, self._adapter, said)
        self._normalization = self._adapter.NORMALIZATION.given(said)
        self._threshold = said.score_threshold or SCORE_THRESHOLD
        self._decode: Decode = self._adapter.decode
        if self._adapter is heatmap:
            self._decode = partial(heatmap.decode, how=said.decode, udp=said.udp)
        self._side = max(self._graph.width, self._graph.height)
        self._corner = np.array([(self._side - self._graph.width) // 2, (self._side - self._graph.height) // 2])

    def estimate(self, image_rgb: np.ndarray, regions: Sequence[Region]) -> list[PoseEstimate]:
        """One estimate per region of an (H, W, 3) uint8 image; the world landmarks are all 0, which is: not known."""
        return [self._estimate(image_rgb, region) for region in regions]

    def _estimate(self, image_rgb: np.ndarray, region: Region) -> PoseEstimate:
        left, top = self._corner
        square = region.cut(image_rgb, self._side)
        picture = square[top : top + self._graph.height, left : left + self._graph.width]
        points, scores = self._decode(self._graph.run(picture, self._normalization), self._graph)
        pixels = region.image_from_crop((points + self._corner + 0.5) / self._side)
        ours, confidence = self.keypoint_set.to_ours(pixels, np.clip(scores, 0.0, 1.0))
        height, width = image_rgb.shape[:2]
        in_frame = ((ours >= -0.5) & (ours <= [width - 0.5, height - 0.5])).all(axis=1)
        return PoseEstimate(
            keypoints_px=ours,
            visibility=confidence,
            in_frame=in_frame.astype(float),
            world_landmarks=np.zeros((len(KEYPOINT_NAMES), 3)),
            presence=float((confidence[_BODY] >= self._threshold).mean()),
            region=region,
            next_region=self._next_region(ours, confidence, region),
        )

    def _next_region(self, points: np.ndarray, confidence: np.ndarray, region: Region) -> Region:
        """The box round the keypoints that are seen, upright along the trunk, in the network's proportions."""
        seen = confidence >= UNSURE * self._threshold
        if seen.sum() < FEWEST:
            return region
        trunk = points[_SHOULDERS].mean(axis=0) - points[_HIPS].mean(axis=0)
        upright = math.atan2(float(trunk[0]), float(-trunk[1]))
        rotation = upright if seen[[*_SHOULDERS, *_HIPS]].all() else region.rotation
        turned = Region((0.0, 0.0), 1.0, rotation)
        along = points[seen] @ turned.R_image_crop  # in the axes of the box
        low, high = along.min(axis=0), along.max(axis=0)
        shape = np.array([self._graph.width, self._graph.height]) / self._side
        around = MARGIN * float(((high - low) / shape).max())
        side = max(around, SHRINKS * region.side_px, STATURE * _stature(points, seen))
        x, y = turned.R_image_crop @ ((low + high) / 2)
        return Region((float(x), float(y)), side, rotation)


def _stature(points: np.ndarray, seen: np.ndarray) -> float:
    """Length in pixels of trunk, thigh and lower leg, whichever way they are bent; 0 for what is not seen."""
    ends = [points[pair].mean(axis=0) for pair in (_SHOULDERS, _HIPS)]
    trunk = math.dist(*ends) if seen[[*_SHOULDERS, *_HIPS]].all() else 0.0
    legs = [
        sum(math.dist(points[a], points[b]) for a, b in zip(leg, leg[1:], strict=False)) if seen[leg].all() else 0.0
        for leg in _LEGS
    ]
    return trunk + max(legs)


def _adapter_for(graph: Graph, said: Description) -> ModuleType:
    adapter = next((a for a in _ADAPTERS if a.recognises(graph) and said.type in (None, a.TYPE)), None)
    if adapter is None:
        why = f"it is not {said.type}" if said.type else "its outputs do not tell what it is"
        raise graph.unrecognised("a keypoint network", KEYPOINT_TYPES, why)
    return adapter


def _set_for(graph: Graph, adapter: ModuleType, said: Description) -> KeypointSet:
    count = adapter.keypoint_count(graph)
    found = KEYPOINT_SETS[said.keypoints] if said.keypoints else keypoint_set_of_count(count)
    if found is None or found.count > count:
        sets = ", ".join(f"{s.name} ({s.count})" for s in KEYPOINT_SETS.values())
        raise ModelFileError(
            f"{graph.path} gives {count} keypoints, which is none of {sets}; if it begins with those of one of these, "
            f'say so in {description_path(graph.path)}: {{"keypoints": "coco17"}}'
        )
    return found
