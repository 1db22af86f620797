# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of the overlay: which frames, how large, and never too many bytes."""

from __future__ import annotations

import cv2
import numpy as np
from scope.scope_addon.report.footage_pictures import Picture, bounded, small_picture, spread_rows


def test_rows_are_spread_from_the_first_to_the_last():
    assert spread_rows(101, 5).tolist() == [0, 25, 50, 75, 100]
    assert spread_rows(3, 40).tolist() == [0, 1, 2]
    assert spread_rows(1, 40).tolist() == [0]


def test_a_picture_is_a_small_webp_of_the_same_content():
    image = np.zeros((1000, 1600, 3), np.uint8)
    image[:, 800:] = (250, 60, 20)
    picture = small_picture(7, image)
    assert (picture.row, picture.width, picture.height) == (7, 800, 500)
    assert picture.url.startswith("data:image/webp;base64,")
    back = cv2.cvtColor(
        cv2.imdecode(np.frombuffer(picture.content, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB
    )
    assert back.shape == (500, 800, 3)
    assert np.abs(back[250, 600].astype(int) - (250, 60, 20)).max() < 12
    assert back[250, 200].max() < 12


def test_pictures_that_are_too_large_together_become_fewer():
    pictures = [Picture(row, b"x" * 100, 1, 1) for row in range(9)]
    assert [p.row for p in bounded(pictures, 300)] == [0, 4, 8]
    assert len(bounded(pictures, 900)) == 9
    assert len(bounded(pictures, 10)) == 1
