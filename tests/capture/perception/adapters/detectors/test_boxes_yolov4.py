# SPDX-License-Identifier: GPL-3.0-or-later
"""YOLOv4's outputs: boxes as fractions of the stretched image, and scores, in either order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.perception.adapters.detectors.box_detector import BoxDetector
from scope.solver.errors import ModelFileError

from ....small_graphs import fixed
from .person_in_picture import HEIGHT, PERSON, WIDTH, assert_finds_the_person


@pytest.mark.parametrize("order", [("boxes", "confs"), ("confs", "boxes")])
def test_yolov4(tmp_path: Path, order: tuple[str, str]) -> None:
    boxes, scores = np.zeros((1, 40, 1, 4), np.float32), np.zeros((1, 40, 80), np.float32)
    boxes[0, 5, 0] = PERSON / [333, 251, 333, 251]
    scores[0, 5, 0] = 0.9
    boxes[0, 6, 0], scores[0, 6, 2] = [0.1, 0.1, 0.2, 0.2], 0.99
    outputs = {"boxes": boxes, "confs": scores}
    path = fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {name: outputs[name] for name in order})
    assert_finds_the_person(path, "yolov4")


def test_different_numbers_of_boxes_and_scores_are_refused(tmp_path: Path) -> None:
    outputs = {"boxes": np.zeros((1, 40, 1, 4), np.float32), "confs": np.zeros((1, 39, 80), np.float32)}
    path = fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, outputs)
    (tmp_path / "m.json").write_text('{"type": "yolov4"}')
    with pytest.raises(ModelFileError, match=r"do not match a yolov4 detector.*m\.json"):
        BoxDetector(path, threads=1)
