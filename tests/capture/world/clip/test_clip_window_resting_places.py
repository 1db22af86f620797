# SPDX-License-Identifier: GPL-3.0-or-later
"""Places at which points rest, on points whose rests are known."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.capture.world.clip_window import resting_places

T = 30
# metres; the point rests in frames 0 to 11 and 18 to 29
STEP = np.where(np.arange(T) < 15, 0.0, 0.4)
RESTING = np.where((np.arange(T) < 12) | (np.arange(T) >= 18), 0.9, 0.1)[:, None]


def _points(noise_m: float) -> np.ndarray:
    points = np.zeros((T, 1, 3))
    points[:, 0, 0] = STEP
    points[:, 0, 2] = 4.0 + noise_m * np.linspace(-1.0, 1.0, T)
    return points


def test_each_rest_has_one_place_where_the_point_is_on_average():
    places, p = resting_places(_points(0.01), RESTING)
    np.testing.assert_allclose(p, np.where(RESTING > 0.5, RESTING, 0.0))
    for rest in (slice(0, 12), slice(18, T)):
        np.testing.assert_allclose(
            places[rest, 0], np.tile(_points(0.01)[rest, 0].mean(axis=0), (12, 1))
        )


def test_a_point_that_strays_has_no_place():
    assert not resting_places(_points(0.1), RESTING)[1].any()


def test_a_point_that_never_rests_has_no_place():
    assert not resting_places(_points(0.0), np.zeros((T, 1)))[1].any()
