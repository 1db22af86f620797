# SPDX-License-Identifier: GPL-3.0-or-later
"""What all types of detectors share: the JSON beside the network, unknown graphs, and values that
are not finite.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.perception.adapters.box_detector import BoxDetector
from scope.solver.errors import ModelFileError

from ...small_graphs import fixed
from .person_in_picture import CELLS, HEIGHT, IMAGE, WIDTH, yolox_rows


def test_the_json_takes_precedence(tmp_path: Path) -> None:
    columns = np.zeros((84, CELLS), np.float32)
    columns[[0, 1, 2, 3, 7], 3] = [50, 50, 40, 40, 0.35]
    path = fixed(tmp_path / "m.onnx", "width", "height", {"output0": columns[None]})
    with pytest.raises(ModelFileError, match=r"any size.*m\.json.*input_size"):
        BoxDetector(path, threads=1)
    settings = {"input_size": [WIDTH, HEIGHT], "score_threshold": 0.3, "person_class": 3}
    (tmp_path / "m.json").write_text(json.dumps(settings))
    assert len(BoxDetector(path, threads=1).detect(IMAGE)) == 1


def test_a_graph_of_unknown_type_is_refused(tmp_path: Path) -> None:
    path = fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"what": np.zeros((1, 7), np.float32)})
    with pytest.raises(ModelFileError, match=r"what \[1, 7\].*yolox, yolov8.*m\.json"):
        BoxDetector(path, threads=1)
    (tmp_path / "m.json").write_text('{"type": "yolov8"}')
    with pytest.raises(ModelFileError, match="do not match a yolov8 detector"):
        BoxDetector(path, threads=1)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e38])
def test_nan_and_infinity_are_ignored(tmp_path: Path, value: float) -> None:
    rows, person = yolox_rows(80)
    rows[50:60] = value
    detector = BoxDetector(
        fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"output": rows[None]}), threads=1
    )
    scores = [found.score for found in detector.detect(IMAGE)]
    assert len(scores) > 0  # the person, whom they do not hide
    assert np.isfinite(scores).all()
