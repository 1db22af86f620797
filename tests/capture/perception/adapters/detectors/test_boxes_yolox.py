# SPDX-License-Identifier: GPL-3.0-or-later
"""YOLOX's output, with boxes in pixels or relative to their cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ....small_graphs import fixed
from .person_in_picture import HEIGHT, WIDTH, assert_finds_the_person, yolox_rows


@pytest.mark.parametrize("classes", [1, 80])
def test_yolox_decoded(tmp_path: Path, classes: int) -> None:
    rows, _ = yolox_rows(classes)
    assert_finds_the_person(fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"output": rows[None]}), "yolox")


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
    assert_finds_the_person(fixed(tmp_path / "m.onnx", WIDTH, HEIGHT, {"output": raw[None]}), "yolox")
