# SPDX-License-Identifier: GPL-3.0-or-later
"""The sheet shows the middle of each clip, in order."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scope.benchmarks.scenes.sheet import COLUMNS, HEIGHT, ROWS, WIDTH, sheet

GRAY = (60, 120, 180)  # of the clips' middle frames; the others are black


@pytest.fixture
def clips(tmp_path):
    paths = []
    for k, gray in enumerate(GRAY):
        paths.append(tmp_path / f"{k}.avi")
        video = cv2.VideoWriter(str(paths[-1]), cv2.VideoWriter_fourcc(*"MJPG"), 15, (96, 64))
        for f in range(5):
            video.write(np.full((64, 96, 3), gray if f == 2 else 0, np.uint8))
        video.release()
    return paths


def test_middles_are_shown_in_order_and_the_rest_is_empty(clips):
    picture = sheet(clips)
    assert picture.shape == (ROWS * HEIGHT, COLUMNS * WIDTH, 3)
    shown = [np.median(picture[:HEIGHT, k * WIDTH : (k + 1) * WIDTH]) for k in range(COLUMNS)]
    np.testing.assert_allclose(shown[:3], GRAY, atol=4)
    assert not any(shown[3:])


def test_a_clip_that_cannot_be_read_is_named(tmp_path):
    (tmp_path / "broken.mp4").write_bytes(b"nothing")
    with pytest.raises(ValueError, match=r"broken\.mp4"):
        sheet([tmp_path / "broken.mp4"])
