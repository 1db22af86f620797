# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact frame rates from the rounded ones that containers and OpenCV give."""

from __future__ import annotations

from fractions import Fraction

import pytest
from scope.scope_addon.capture.media.frame_readers import exact_fps


@pytest.mark.parametrize(
    ("fps", "expected"),
    [
        (30000 / 1001, Fraction(30000, 1001)),
        (29.97, Fraction(2997, 100)),
        (29.9701, Fraction(30000, 1001)),
        (23.97602, Fraction(24000, 1001)),
        (12.5, Fraction(25, 2)),
        (29.8, Fraction(149, 5)),
        (0.0, None),
        (float("nan"), None),
        (90000.0, None),
    ],
)
def test_exact_fps(fps, expected):
    assert exact_fps(fps) == expected
