# SPDX-License-Identifier: GPL-3.0-or-later
"""The bootstrap over people, and over performers."""

import numpy as np
from scope.benchmarks.scenes.statistics import mean_over_people, mean_over_performers


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


def test_people_of_one_performer_count_together():
    values = np.repeat([10.0, 20.0, 60.0], 50)
    performers = np.repeat(["a", "b", "c"], 50)
    found = mean_over_performers(values, performers)
    assert (found.mean, found.people) == (30.0, 150)
    assert (found.low, found.high) == (10.0, 60.0)  # one performer in 27 draws is drawn alone
    over_people = mean_over_people(values)
    assert over_people.high - over_people.low < 8.0
    assert np.isnan(mean_over_performers([1.0, 2.0, np.nan], ["a", "a", "b"]).low)


def test_the_interval_over_performers_covers_the_true_mean_of_many():
    rng = np.random.default_rng(2)
    inside = 0
    for _ in range(100):
        performers = np.repeat(np.arange(20), 5)
        values = rng.normal(50.0, 10.0, 20)[performers] + rng.normal(0.0, 3.0, 100)
        found = mean_over_performers(values, performers)
        inside += found.low <= 50.0 <= found.high
    assert 85 <= inside <= 100
