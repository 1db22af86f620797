# SPDX-License-Identifier: GPL-3.0-or-later
"""MMDeploy's detectors, whose normalization only their JSON says."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.perception.adapters.detectors.box_detector import BoxDetector
from scope.solver.errors import ModelFileError

from ....small_graphs import fixed
from .person_in_picture import HEIGHT, PERSON, WIDTH, assert_finds_the_person, in_picture


def test_detections_need_their_normalization(tmp_path: Path) -> None:
    rows = np.array([[[*in_picture(PERSON), 0.9], [1, 1, 9, 9, 0.95]]], np.float32)
    path = fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"dets": rows, "labels": np.array([[0, 3]])})
    with pytest.raises(ModelFileError, match=r"m\.json.*\"mean\""):
        BoxDetector(path, threads=1)
    description = {"type": "detections", "mean": 0, "std": 1, "channel_order": "bgr"}
    (tmp_path / "m.json").write_text(json.dumps(description))
    assert_finds_the_person(path, "detections")
