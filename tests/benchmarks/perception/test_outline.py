# SPDX-License-Identifier: GPL-3.0-or-later
"""The measure of silhouettes: figures by hand, and a body drawn into a rotated region where its
projection lies.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.benchmarks.perception.outline import overlap


def test_figures_of_two_rectangles() -> None:
    """The body covers 6 x 4 pixels, the mask 6 x 8, of which 2 columns lie outside the image; 12
    are common.
    """
    shape = np.ones((256, 256), np.uint8)
    mask = np.zeros((256, 256), bool)
    shape[10:16, 20:24] = 2
    mask[10:16, 22:30] = True
    shape[:, 28:] = 0
    found = overlap(shape, mask)
    assert found == pytest.approx(
        {"iou": 12 / (24 + 36 - 12), "body_outside": 0.5, "mask_outside": 1 - 12 / 36}
    )
    assert overlap(shape, np.zeros_like(mask)) is None
