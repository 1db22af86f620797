# SPDX-License-Identifier: GPL-3.0-or-later
"""A person at a known place in an image of an odd size, for the detectors' small graphs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.perception.adapters.box_detector import BoxDetector, cells

# of the networks
WIDTH = 160
HEIGHT = 96
# 251 / 96 is more than 333 / 160: as high as the network's picture
IMAGE = np.zeros((251, 333, 3), np.uint8)
SCALE = HEIGHT / 251
COLUMNS = round(333 * SCALE)  # 127 of the 160
# The person in the image, left, top, right, bottom from its top left edge; one of a pixel is half
# of it left.
PERSON = np.array([50.0, 20.0, 130.0, 230.0])
CELLS = len(cells(WIDTH, HEIGHT))


def in_picture(box: np.ndarray, left: float = 0.0) -> np.ndarray:
    """Convert a box from the image to the network's letterboxed input."""
    x = COLUMNS / 333
    return box * [x, SCALE, x, SCALE] + [left, 0, left, 0]


def center_size(box: np.ndarray) -> np.ndarray:
    return np.array(
        [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2, box[2] - box[0], box[3] - box[1]]
    )


def assert_finds_the_person(path: Path, kind: str, score: float = 0.9) -> None:
    detector = BoxDetector(path, threads=1)
    assert detector.type == kind
    (found,) = detector.detect(IMAGE)
    np.testing.assert_allclose(found.box_px, PERSON - 0.5, atol=0.01)
    assert found.score == pytest.approx(score, abs=1e-4)
    region = found.region
    np.testing.assert_allclose(region.center_px, (89.5, 124.5), atol=0.01)
    assert region.side_px == pytest.approx(1.25 * 210, abs=0.02)
    assert region.rotation == 0


def yolox_rows(classes: int) -> tuple[np.ndarray, int]:
    """Create decoded rows with the person, twice, and something else in cells of their own."""
    rows = np.zeros((CELLS, 5 + classes), np.float32)
    grid = cells(WIDTH, HEIGHT)
    rows[:, :2] = (grid[:, :2] + 0.5) * grid[:, 2:]
    rows[:, 2:4] = grid[:, 2:]
    box = center_size(in_picture(PERSON))
    rows[33] = [*box, 0.95, 0.9 / 0.95, *[0] * (classes - 1)]
    rows[34] = [*(box + [0.5, 0, 0, 1]), 0.9, 0.8, *[0] * (classes - 1)]
    if classes > 1:
        rows[70] = [20, 20, 30, 30, 0.99, 0, 0.99, *[0] * (classes - 2)]
    return rows, 33
