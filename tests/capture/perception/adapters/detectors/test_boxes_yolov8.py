# SPDX-License-Identifier: GPL-3.0-or-later
"""YOLOv8's output: a column per box."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....small_graphs import fixed
from .person_in_picture import CELLS, COLUMNS, HEIGHT, PERSON, WIDTH, assert_finds_the_person, center_size, in_picture


def test_yolov8(tmp_path: Path) -> None:
    columns = np.zeros((84, CELLS), np.float32)
    left = (WIDTH - COLUMNS) // 2
    columns[:5, 12] = [*center_size(in_picture(PERSON, left)), 0.9]
    columns[:5, 13] = [*(center_size(in_picture(PERSON, left)) + 1), 0.7]
    columns[[0, 1, 2, 3, 7], 100] = [50, 50, 40, 40, 0.99]  # a car
    assert_finds_the_person(fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"output0": columns[None]}), "yolov8")
