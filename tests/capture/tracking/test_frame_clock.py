# SPDX-License-Identifier: GPL-3.0-or-later
"""Intervals end at the nearest frame, whatever the frame rate."""

from __future__ import annotations

import pytest
from scope.scope_addon.capture.tracking.frame_clock import FrameClock


@pytest.mark.parametrize("rate", [5.0, 24.0, 120.0])
def test_an_interval_ends_at_the_nearest_frame(rate: float) -> None:
    clock = FrameClock()
    interval_s = 0.27
    passed = []
    for k in range(200):
        clock.advance(k / rate)
        if k > 0 and clock.has_passed(interval_s, k / rate):
            passed.append(k)
    assert abs(passed[0] / rate - interval_s) <= 0.5 / rate + 1e-9
    assert passed == list(range(passed[0], 200))


def test_frames_without_times_are_a_thirtieth_of_a_second_apart() -> None:
    clock = FrameClock()
    for _ in range(31):
        clock.advance(None)
    assert clock.time_s == pytest.approx(1.0)
    assert clock.begin_s == 0.0
