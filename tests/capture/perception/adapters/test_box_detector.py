# SPDX-License-Identifier: GPL-3.0-or-later
"""What all types of detectors share: the JSON beside the network, unknown graphs, and values that
are not finite.

Outputs of each kind of detector. YOLOX: boxes in pixels or relative to their cells. YOLOv8: a
column per box. YOLOv4: boxes as fractions of the stretched image, and scores, in either order.
A graph that has already suppressed all but the best boxes. MMDeploy's detectors, whose
normalization only their JSON says.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.perception.adapters.box_detector import BoxDetector, cells
from scope.solver.errors import ModelFileError

from ...small_graphs import fixed

pytestmark = pytest.mark.usefixtures("in_this_process")

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


def test_a_graph_of_unknown_type_is_refused(tmp_path: Path) -> None:
    path = fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"what": np.zeros((1, 7), np.float32)})
    with pytest.raises(ModelFileError, match=r"what \[1, 7\].*yolox, yolov8.*m\.json"):
        BoxDetector(path, threads=1)
    (tmp_path / "m.json").write_text('{"type": "yolov8"}')
    with pytest.raises(ModelFileError, match="do not match a yolov8 detector"):
        BoxDetector(path, threads=1)


@pytest.mark.parametrize("value", [np.nan, -np.inf, 1e38])
def test_nan_and_infinity_are_ignored(tmp_path: Path, value: float) -> None:
    rows, person = yolox_rows(80)
    rows[50:60] = value
    detector = BoxDetector(
        fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"output": rows[None]}), threads=1
    )
    scores = [found.score for found in detector.detect(IMAGE)]
    assert len(scores) > 0  # the person, whom they do not hide
    assert np.isfinite(scores).all()


def test_yolox_raw(tmp_path: Path) -> None:
    rows, _ = yolox_rows(80)
    raw = rows.copy()
    # the order of the cells, by its own definition: 20 x 12 of 8 pixels, 10 x 6 of 16, 5 x 3 of 32
    k = 0
    for side, across, down in ((8, 20, 12), (16, 10, 6), (32, 5, 3)):
        for row in range(down):
            for column in range(across):
                raw[k, :2] = rows[k, :2] / side - [column, row]
                raw[k, 2:4] = np.log(rows[k, 2:4] / side)
                k += 1
    assert k == len(raw)
    assert_finds_the_person(
        fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"output": raw[None]}), "yolox"
    )


def test_yolov8(tmp_path: Path) -> None:
    columns = np.zeros((84, CELLS), np.float32)
    left = (WIDTH - COLUMNS) // 2
    columns[:5, 12] = [*center_size(in_picture(PERSON, left)), 0.9]
    columns[:5, 13] = [*(center_size(in_picture(PERSON, left)) + 1), 0.7]
    columns[[0, 1, 2, 3, 7], 100] = [50, 50, 40, 40, 0.99]  # a car
    assert_finds_the_person(
        fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"output0": columns[None]}), "yolov8"
    )


@pytest.mark.parametrize("order", [("boxes", "confs"), ("confs", "boxes")])
def test_yolov4(tmp_path: Path, order: tuple[str, str]) -> None:
    boxes = np.zeros((1, 40, 1, 4), np.float32)
    scores = np.zeros((1, 40, 80), np.float32)
    boxes[0, 5, 0] = PERSON / [333, 251, 333, 251]
    scores[0, 5, 0] = 0.9
    boxes[0, 6, 0] = [0.1, 0.1, 0.2, 0.2]
    scores[0, 6, 2] = 0.99
    outputs = {"boxes": boxes, "confs": scores}
    path = fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {name: outputs[name] for name in order})
    assert_finds_the_person(path, "yolov4")


def test_different_numbers_of_boxes_and_scores_are_refused(tmp_path: Path) -> None:
    outputs = {
        "boxes": np.zeros((1, 40, 1, 4), np.float32),
        "confs": np.zeros((1, 39, 80), np.float32),
    }
    path = fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, outputs)
    (tmp_path / "m.json").write_text('{"type": "yolov4"}')
    with pytest.raises(ModelFileError, match=r"do not match a yolov4 detector.*m\.json"):
        BoxDetector(path, threads=1)


def test_end_to_end(tmp_path: Path) -> None:
    rows = np.zeros((1, 300, 6), np.float32)
    rows[0, 0] = [10, 10, 50, 50, 0.99, 2]
    rows[0, 1] = [*in_picture(PERSON, (WIDTH - COLUMNS) // 2), 0.9, 0]
    assert_finds_the_person(
        fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"output0": rows}), "end_to_end"
    )


def test_detections_need_their_normalization(tmp_path: Path) -> None:
    rows = np.array([[[*in_picture(PERSON), 0.9], [1, 1, 9, 9, 0.95]]], np.float32)
    path = fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"dets": rows, "labels": np.array([[0, 3]])})
    with pytest.raises(ModelFileError, match=r"m\.json.*\"mean\""):
        BoxDetector(path, threads=1)
    description = {"type": "detections", "mean": 0, "std": 1, "channel_order": "bgr"}
    (tmp_path / "m.json").write_text(json.dumps(description))
    assert_finds_the_person(path, "detections")
