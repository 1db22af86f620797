# SPDX-License-Identifier: GPL-3.0-or-later
"""The bootstrap over people."""

import numpy as np
from scope.benchmarks.scenes.statistics import mean_over_people


def test_the_interval_is_the_normal_distributions():
    values = np.random.default_rng(0).normal(50.0, 12.0, 400)
    found = mean_over_people(values)
    half = 1.96 * values.std() / np.sqrt(400)
    np.testing.assert_allclose(
        [found.mean, found.low, found.high], values.mean() + half * np.array([0, -1, 1]), atol=0.1
    )
    assert found.people == 400


def test_the_interval_covers_the_true_mean_as_often_as_it_says():
    rng = np.random.default_rng(1)
    inside = 0
    for _ in range(100):
        found = mean_over_people(rng.exponential(10.0, 40))
        inside += found.low <= 10.0 <= found.high
    assert 86 <= inside <= 100


def test_people_without_a_value_do_not_count():
    assert mean_over_people([np.nan, 3.0, 5.0])[::3] == (4.0, 2)
    alone = mean_over_people([7.0, np.nan])
    assert (alone.mean, alone.people) == (7.0, 1)
    assert np.isnan([alone.low, alone.high]).all()
    assert np.isnan(mean_over_people([]).mean)
