# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds people in a whole image with BlazePose's detector: a box round the face and the circle round the body."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from .execution import Execution
from .letterbox import fit_in
from .non_maximum_suppression import overlap_clusters
from .region import Region, region_from_points
from .sessions import network_path, open_session

INPUT_SIZE = 224
SCORE_THRESHOLD = 0.5
OVERLAP_THRESHOLD = 0.3
_LAYERS = ((8, 2), (16, 2), (32, 6))  # stride, anchors per cell; the three stride-32 layers lie together
_SCORE_LIMIT = 100.0
_SURE_SCORE = 0.8  # of a person who fills a good part of the image
_SQUARES_FROM = 1.2  # ratio of the sides from which squares show anything larger


@dataclass(frozen=True)
class Detection:
    """One person: ``score`` 0..1, face box (left, top, right, bottom) and 4 points (x, y), all in image pixels.

    Point 0 is the middle of the hips, point 1 lies on the circle about it that holds the body, above the head.
    """

    score: float
    box_px: np.ndarray
    points_px: np.ndarray

    @property
    def region(self) -> Region:
        """Where the landmark network should look."""
        return region_from_points(self.points_px[0], self.points_px[1])


class PersonDetector:
    """The detection network on the CPU. One call looks at one image; nothing is kept between calls."""

    def __init__(self, threads: int, folder: Path | None = None, execution: Execution | None = None) -> None:
        self._session = open_session(network_path("pose_detection", folder), threads, execution)
        self._anchors = make_anchors()

    def detect(
        self, image_rgb: np.ndarray, threshold: float = SCORE_THRESHOLD, closely: bool = False
    ) -> list[Detection]:
        """All people in an (H, W, 3) uint8 image with a score of at least ``threshold``, best first.

        Looks once at the whole image. Where that finds nobody it is sure of, or ``closely`` is asked for, and the image
        is oblong, overlapping squares of its shorter side follow: they show the people larger.
        """
        found = self._detect_in(image_rgb, threshold, (0, 0))
        if closely or not found or found[0].score < _SURE_SCORE:
            for left, top, side in squares(*image_rgb.shape[:2]):
                found += self._detect_in(image_rgb[top : top + side, left : left + side], threshold, (left, top))
            found = unique(found)
        return found

    def _detect_in(self, image_rgb: np.ndarray, threshold: float, corner: tuple[int, int]) -> list[Detection]:
        picture, scale, offset = letterbox(image_rgb)
        blob = cv2.dnn.blobFromImage(picture, 1 / 127.5, mean=(127.5, 127.5, 127.5))
        boxes, scores = self._session.run(["boxes", "scores"], {"input": blob})
        score, values = decode(boxes[0], scores[0, :, 0], self._anchors, threshold)
        score, values = merge_overlapping(score, values)
        values = (values.reshape(-1, 6, 2) - offset) / scale - 0.5 + corner
        return [Detection(float(s), v[:2].ravel(), v[2:]) for s, v in zip(score, values, strict=True)]


def squares(height: int, width: int) -> list[tuple[int, int, int]]:
    """(left, top, side) of the overlapping squares that cover an oblong image along its longer side; none if square."""
    side, length = min(height, width), max(height, width)
    if length < _SQUARES_FROM * side:
        return []
    places = np.linspace(0, length - side, math.ceil(length / side)).astype(int).tolist()
    return [(place, 0, side) if width > height else (0, place, side) for place in places]


def unique(detections: list[Detection]) -> list[Detection]:
    """Drop every detection whose hips lie well inside the body circle of a better one of similar size; best first."""
    kept: list[Detection] = []
    for detection in sorted(detections, key=lambda d: -d.score):
        if not any(detection.region.resembles(other.region, 0.25) for other in kept):
            kept.append(detection)
    return kept


def letterbox(image_rgb: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """Fit the image into the centre of a black 224 × 224 square.

    Returns the square, the scale and the (x, y) offset: square = scale · (pixel + ½) + offset.
    """
    fitted = fit_in(image_rgb, INPUT_SIZE, INPUT_SIZE, border=0)
    return fitted.picture_rgb, INPUT_SIZE / max(image_rgb.shape[:2]), fitted.offset


def make_anchors(size: int = INPUT_SIZE, strides: tuple[tuple[int, int], ...] = _LAYERS) -> np.ndarray:
    """(N, 2) anchor centres in input pixels, in the network's order: by layer, row, column, anchor of the cell.

    ``strides``: stride and anchors per cell of each layer; the person detector has 2254 anchors.
    """
    layers = []
    for stride, per_cell in strides:
        cells = (np.arange(size // stride) + 0.5) * stride
        y, x = np.meshgrid(cells, cells, indexing="ij")
        layers.append(np.repeat(np.stack([x, y], -1).reshape(-1, 2), per_cell, axis=0))
    return np.concatenate(layers)


def decode(
    boxes: np.ndarray, logits: np.ndarray, anchors: np.ndarray, threshold: float
) -> tuple[np.ndarray, np.ndarray]:
    """Scores (N,) and values (N, 4 + 2n) = left, top, right, bottom, n × (x, y) in input pixels, best first.

    The network gives per anchor the box's centre and the points relative to the anchor, and the box's size.
    """
    score = 1.0 / (1.0 + np.exp(-np.clip(logits.astype(float), -_SCORE_LIMIT, _SCORE_LIMIT)))
    chosen = np.flatnonzero(score >= threshold)
    chosen = chosen[np.argsort(-score[chosen], kind="stable")]
    raw, anchor = boxes[chosen].astype(float), anchors[chosen]
    center, half = raw[:, :2] + anchor, raw[:, 2:4] / 2
    points = raw[:, 4:] + np.tile(anchor, (1, raw.shape[1] // 2 - 2))
    return score[chosen], np.concatenate([center - half, center + half, points], axis=1)


def merge_overlapping(score: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weighted non-maximum suppression: each cluster becomes its score-weighted mean with its best score.

    See `overlap_clusters`; ``score`` descends.
    """
    clusters = overlap_clusters(values[:, :4], OVERLAP_THRESHOLD)
    merged = [score[cluster] @ values[cluster] / score[cluster].sum() for cluster in clusters]
    best = np.array([cluster[0] for cluster in clusters], int)
    return score[best], np.array(merged).reshape(-1, values.shape[1])
