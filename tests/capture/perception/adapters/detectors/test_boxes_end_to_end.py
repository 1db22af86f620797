# SPDX-License-Identifier: GPL-3.0-or-later
"""Detectors whose graph has already suppressed all but the best boxes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....small_graphs import fixed
from .person_in_picture import COLUMNS, HEIGHT, PERSON, WIDTH, assert_finds_the_person, in_picture


def test_end_to_end(tmp_path: Path) -> None:
    rows = np.zeros((1, 300, 6), np.float32)
    rows[0, 0] = [10, 10, 50, 50, 0.99, 2]
    rows[0, 1] = [*in_picture(PERSON, (WIDTH - COLUMNS) // 2), 0.9, 0]
    assert_finds_the_person(fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"output0": rows}), "end_to_end")
