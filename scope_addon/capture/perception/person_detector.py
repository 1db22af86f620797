# SPDX-License-Identifier: GPL-3.0-or-later
"""BlazePose's person detector: the face box and the body circle of every person in an image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from ...arrays import Float32Array, Float64Array, IndexArray, Uint8Array
from .region import Region, fit_in, region_from_points
from .sessions import Execution, network_path, open_session

INPUT_SIZE = 224
SCORE_THRESHOLD = 0.5
OVERLAP_THRESHOLD = 0.3
# Stride and anchors per cell; the three layers of stride 32 are combined.
_LAYERS = ((8, 2), (16, 2), (32, 6))
_SCORE_LIMIT = 100.0
# From this score on the squares are not searched: such a person fills a good part of the image.
_SURE_SCORE = 0.8
_SQUARES_FROM = 1.2  # aspect ratio from which squares show people larger
_SMALL_SCORE = 0.8  # least score of a small person: more squares hold more that resembles a person
# Detections of one person differ by at most this much at the shoulders, in sides of the region.
# People who stand side by side are about twice as far apart.
SAME_SHOULDERS = 0.08
# Of two detections whose hips are closer, in sides of the larger region, one may be a duplicate.
_NEAR_HIPS = 0.25
# The cosine of the largest angle between the trunks of people who stand beside each other.
_PARALLEL = 0.5
# How much smaller the region of somebody in a crowd is, so that it shows less of the others.
_CROWDED_SIDE = 0.85


class Search(NamedTuple):
    """Squares of an image in which people are looked for whom it shows too small; each takes as
    long as the whole image.
    """

    side: float  # in shorter sides of the image
    step: float  # the largest to the next one, in sides; the rest holds such a person's height


# For people of about a fifth to two fifths of the shorter side, four to eight squares: beside
# somebody larger, their scores are low even in an image that shows them large enough.
IN_PARTS = Search(side=0.6, step=2 / 3)
# For people of about a tenth to a quarter of the shorter side, some thirty to fifty squares.
FOR_SMALL = Search(side=1 / 3, step=0.6)


@dataclass(frozen=True)
class Detection:
    """One detected person.

    ``score`` 0..1; ``box_px`` (4,) left, top, right, bottom of the face; ``points_px`` (4, 2), both
    in image pixels. Point 0 is the hip centre, point 1 lies on the body circle around it, above the
    head; point 2 is the centre of the shoulders. A detector of boxes puts it at the hips.
    """

    score: float
    box_px: Float64Array
    points_px: Float64Array

    @property
    def region(self) -> Region:
        """The region for the landmark network."""
        return region_from_points(self.points_px[0], self.points_px[1])

    @property
    def trunk_px(self) -> Float64Array:
        """The vector (2,) from the shoulders to the hips."""
        return self.points_px[0] - self.points_px[2]

    def near(self, others: list[Detection]) -> list[Detection]:
        """Select those of similar size with the hips well inside the body circle."""
        return [other for other in others if self.region.resembles(other.region, _NEAR_HIPS)]

    def is_beside(self, other: Detection) -> bool:
        """Return whether the shoulders are those of two people, as upright as each other.

        The network pulls the hips of people who stand close together towards each other, but not
        their shoulders. It also detects people in a trunk, whose shoulders are further down in it,
        and in legs, where they are upside down.
        """
        lengths = np.linalg.norm(self.trunk_px) * np.linalg.norm(other.trunk_px)
        if self.trunk_px @ other.trunk_px <= _PARALLEL * lengths:
            return False
        dx, dy = self.points_px[2] - other.points_px[2]
        along_x, along_y = other.trunk_px / np.linalg.norm(other.trunk_px)
        across_px = abs(dx * along_y - dy * along_x)
        larger_px = max(self.region.side_px, other.region.side_px)
        return bool(across_px > SAME_SHOULDERS * larger_px)

    def has_shoulders_of(self, other: Detection) -> bool:
        """Return whether the shoulders of both are at the same place."""
        larger_px = max(self.region.side_px, other.region.side_px)
        return math.dist(self.points_px[2], other.points_px[2]) <= SAME_SHOULDERS * larger_px

    def turned_back(self, quarter_turns: int, width: int, height: int) -> Detection:
        """Convert a detection in a turned image to one in the image.

        :param quarter_turns: counterclockwise, as ``np.rot90`` has turned the image.
        :param width, height: of the image, pixels.
        """
        corners = self.box_px.reshape(2, 2)
        points = np.concatenate([corners, self.points_px])
        for turn in range(quarter_turns, 0, -1):
            # The width of the image from which this quarter turn was made.
            side = width if turn % 2 else height
            points = np.stack([side - 1 - points[:, 1], points[:, 0]], axis=1)
        low = points[:2].min(axis=0)
        high = points[:2].max(axis=0)
        return Detection(self.score, np.concatenate([low, high]), points[2:])


class PersonDetector:
    """The detection network; stateless between calls.

    :raises SetupError: the network has not been built.
    :raises ModelFileError: its file is damaged.
    """

    def __init__(self, threads: int, execution: Execution | None = None) -> None:
        self._session = open_session(network_path("pose_detection"), threads, execution)
        self._anchors = make_anchors()

    def detect(self, image_rgb: Uint8Array, closely: bool = False) -> list[Detection]:
        """Detect all people in an (H, W, 3) uint8 RGB image, best first.

        Searches the whole image. If that finds nobody with a high score, or with ``closely``, the
        search continues in overlapping squares of an oblong image, which show people larger.
        """
        found = self._detect_in(image_rgb, SCORE_THRESHOLD, (0, 0))
        if closely or not found or found[0].score < _SURE_SCORE:
            around = squares(*image_rgb.shape[:2])
            found = unique(found + self._detect_in_squares(image_rgb, around, SCORE_THRESHOLD))
        return found

    def detect_smaller(self, image_rgb: Uint8Array, search: Search) -> list[Detection]:
        """Detect people whom `detect` misses in an (H, W, 3) uint8 RGB image, best first."""
        height, width = image_rgb.shape[:2]
        grid = grid_of_squares(height, width, search.side, search.step)
        return unique(self._detect_in_squares(image_rgb, grid, _SMALL_SCORE))

    def detect_turned(self, image_rgb: Uint8Array) -> list[Detection]:
        """Return nothing for any (H, W, 3) image: `detect` finds people at any turn."""
        return []

    def _detect_in_squares(
        self, image_rgb: Uint8Array, around: list[tuple[int, int, int]], threshold: float
    ) -> list[Detection]:
        found: list[Detection] = []
        for left, top, side in around:
            part_rgb = image_rgb[top : top + side, left : left + side]
            found += self._detect_in(part_rgb, threshold, (left, top))
        return found

    def _detect_in(
        self, image_rgb: Uint8Array, threshold: float, corner: tuple[int, int]
    ) -> list[Detection]:
        fitted = fit_in(image_rgb, INPUT_SIZE, INPUT_SIZE, border=0)
        scale = INPUT_SIZE / max(image_rgb.shape[:2])
        blob = cv2.dnn.blobFromImage(fitted.picture_rgb, 1 / 127.5, mean=(127.5, 127.5, 127.5))
        boxes, scores = self._session.run(["boxes", "scores"], {"input": blob})
        score, values = decode(boxes[0], scores[0, :, 0], self._anchors, threshold)
        score, values = merge_overlapping(score, values)
        values = (values.reshape(-1, 6, 2) - fitted.offset) / scale - 0.5 + corner
        return [
            Detection(float(s), v[:2].ravel(), v[2:]) for s, v in zip(score, values, strict=True)
        ]


def squares(height: int, width: int) -> list[tuple[int, int, int]]:
    """Calculate (left, top, side) of the overlapping squares that cover an image; none if it is
    nearly square.
    """
    if max(height, width) < _SQUARES_FROM * min(height, width):
        return []
    return grid_of_squares(height, width, share=1.0, step=1.0)


def grid_of_squares(
    height: int, width: int, share: float, step: float
) -> list[tuple[int, int, int]]:
    """Calculate (left, top, side) of squares that cover an image, row by row.

    :param share: their side, in shorter sides of the image.
    :param step: the largest from one to the next, in sides.
    """
    side = max(1, round(min(height, width) * share))
    starts = [
        np.linspace(0, length - side, math.ceil((length - side) / (side * step)) + 1)
        .astype(int)
        .tolist()
        for length in (height, width)
    ]
    return [(left, top, side) for top in starts[0] for left in starts[1]]


def unique(detections: list[Detection]) -> list[Detection]:
    """Drop detections whose hips are well inside the body circle of a better one of similar size,
    unless it is somebody beside it; best first.
    """
    kept: list[Detection] = []
    for detection in sorted(detections, key=lambda d: -d.score):
        if all(detection.is_beside(other) for other in detection.near(kept)):
            kept.append(detection)
    return kept


def possible_regions(detection: Detection, detections: list[Detection]) -> list[Region]:
    """Return the regions in which the landmark network may find a detected person: the detection's
    own, and a second one for a person standing close to others.

    In the second one, the trunk hangs from the person's own shoulders and is the mean of all trunks
    there, in which the pulls from both sides cancel. It is smaller, because the network would take
    the largest person in it.
    """
    near = detection.near(detections)
    trunks = [other.trunk_px for other in near if detection.is_beside(other)]
    if not trunks:
        return [detection.region]
    trunk_px = np.mean([detection.trunk_px, *trunks], axis=0)
    hips_px = detection.points_px[2] + trunk_px
    radius_px = _CROWDED_SIDE * math.dist(detection.points_px[0], detection.points_px[1])
    top_px = hips_px - radius_px * trunk_px / np.linalg.norm(trunk_px)
    return [detection.region, region_from_points(hips_px, top_px)]


def make_anchors(
    size: int = INPUT_SIZE, strides: tuple[tuple[int, int], ...] = _LAYERS
) -> Float64Array:
    """Calculate the anchor centres in the network's order: by layer, row, column, anchor of the
    cell.

    :param size: side of the network's input, pixels.
    :param strides: stride and anchors per cell of each layer.
    :return: (N, 2) x, y in input pixels; N = 2254 for the person detector.
    """
    layers = []
    for stride, per_cell in strides:
        cells = (np.arange(size // stride) + 0.5) * stride
        y, x = np.meshgrid(cells, cells, indexing="ij")
        layers.append(np.repeat(np.stack([x, y], -1).reshape(-1, 2), per_cell, axis=0))
    return np.concatenate(layers)


def decode(
    boxes: Float32Array, logits: Float32Array, anchors: Float64Array, threshold: float
) -> tuple[Float64Array, Float64Array]:
    """Convert the network's raw outputs to boxes and points.

    :param boxes: (A, 4 + 2n): box centre relative to the anchor, box size, n points relative to the
        anchor.
    :param logits: (A,) of the scores.
    :param anchors: (A, 2), see `make_anchors`.
    :return: scores (N,) and values (N, 4 + 2n): left, top, right, bottom, n × (x, y) in input
        pixels; best first.
    """
    score = 1.0 / (1.0 + np.exp(-np.clip(logits.astype(float), -_SCORE_LIMIT, _SCORE_LIMIT)))
    chosen = np.flatnonzero(score >= threshold)
    chosen = chosen[np.argsort(-score[chosen], kind="stable")]
    raw = boxes[chosen].astype(float)
    anchor = anchors[chosen]
    center = raw[:, :2] + anchor
    half = raw[:, 2:4] / 2
    points = raw[:, 4:] + np.tile(anchor, (1, raw.shape[1] // 2 - 2))
    return score[chosen], np.concatenate([center - half, center + half, points], axis=1)


def merge_overlapping(
    score: Float64Array, values: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Merge each cluster of boxes to its score-weighted mean with its best score (weighted
    non-maximum suppression).

    :param score: (N,) descending.
    :param values: (N, 4 + 2n), see `decode`.
    :return: scores (M,) and values (M, 4 + 2n), see `overlap_clusters`.
    """
    clusters = overlap_clusters(values[:, :4], OVERLAP_THRESHOLD)
    merged = [score[cluster] @ values[cluster] / score[cluster].sum() for cluster in clusters]
    best = np.array([cluster[0] for cluster in clusters], int)
    return score[best], np.array(merged).reshape(-1, values.shape[1])


def overlap_clusters(corners: Float64Array, threshold: float) -> list[IndexArray]:
    """Cluster boxes: the best remaining box and all whose intersection over union with it exceeds
    the threshold.

    :param corners: (N, 4 + M) left, top, right, bottom and M more columns; best box first.
    :return: indices of the boxes of each cluster, the best first.
    """
    low = corners[:, :2]
    high = corners[:, 2:4]
    area = np.maximum(high - low, 0).prod(axis=1)
    remaining = np.arange(len(corners))
    clusters = []
    while len(remaining):
        best = remaining[0]
        sides = np.minimum(high[best], high[remaining]) - np.maximum(low[best], low[remaining])
        shared = np.maximum(sides, 0).prod(axis=1)
        same = shared > threshold * (area[best] + area[remaining] - shared)
        same[0] = True
        clusters.append(remaining[same])
        remaining = remaining[~same]
    return clusters
