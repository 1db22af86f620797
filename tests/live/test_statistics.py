# SPDX-License-Identifier: GPL-3.0-or-later
"""Rates and latencies of poses that come at known times."""

import numpy as np
import pytest
from scope.scope_addon.live.statistics import Statistics


def test_rates_are_poses_per_second_since_the_first_and_recently() -> None:
    statistics = Statistics()
    times = np.concatenate([np.arange(0, 10, 0.1), np.arange(10, 20.001, 0.05)]) + 100.0
    for time_s in times:
        statistics.add(time_s - 0.08, time_s)
    assert statistics.poses == len(times)
    assert statistics.rate == pytest.approx((len(times) - 1) / 20.0)
    assert statistics.recent_rate == pytest.approx(20.0)


def test_latencies_are_the_median_and_what_one_in_twenty_exceeds() -> None:
    statistics = Statistics()
    for k in range(1, 101):
        assert statistics.add(k - 0.001 * k, float(k)) == pytest.approx(k, rel=1e-9)
    assert statistics.latency_ms() == pytest.approx((50.5, 95.05))


def test_before_the_second_pose_there_is_no_rate() -> None:
    statistics = Statistics()
    assert (statistics.rate, statistics.recent_rate, statistics.latency_ms()) == (
        0.0,
        0.0,
        (0.0, 0.0),
    )
    statistics.add(1.0, 1.5)
    assert (statistics.rate, statistics.recent_rate, statistics.poses) == (0.0, 0.0, 1)
    statistics.add(1.0, 1.5)  # of another person, at the same time
    assert (statistics.rate, statistics.recent_rate) == (0.0, 0.0)
