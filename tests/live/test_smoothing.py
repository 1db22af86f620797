# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses after the causal filter: still ones stay, moving ones come as late as is said, and noise is
less.
"""

import numpy as np
import pytest
from scope.scope_addon.live.smoothing import DELAY_S, PoseFilter
from scope.solver.rotations import exp, log

AXIS = np.array([0.6, 0.0, 0.8])
PLACE = np.array([0.4, 0.2, 4.0])


def filtered(
    angles: np.ndarray, places: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the filtered angles about the axis, and places (T, 3)."""
    smooth = PoseFilter()
    found = [
        smooth(exp(a * AXIS)[None], p, t) for a, p, t in zip(angles, places, times, strict=True)
    ]
    return np.array([log(R[0]) @ AXIS for R, _ in found]), np.array([p for _, p in found])


@pytest.mark.parametrize("fps", [15, 30, 60])
def test_who_stands_still_stays_where_they_are(fps: int) -> None:
    times = np.arange(3 * fps) / fps
    angles, places = filtered(np.full(len(times), 0.7), np.tile(PLACE, (len(times), 1)), times)
    np.testing.assert_allclose(angles, 0.7, atol=1e-6)
    np.testing.assert_allclose(places, np.tile(PLACE, (len(times), 1)), atol=1e-6)


@pytest.mark.parametrize("fps", [30, 60])
def test_an_even_motion_comes_late_by_the_delay(fps: int) -> None:
    times = np.arange(4 * fps) / fps
    places = PLACE + times[:, None] * [0.5, 0.0, 0.0]
    angles, found = filtered(0.8 * times, places, times)
    late = 0.8 * (times - DELAY_S)
    np.testing.assert_allclose(angles[2 * fps :], late[2 * fps :], atol=0.01)
    np.testing.assert_allclose(found[2 * fps :, 0], places[2 * fps :, 0] - 0.5 * DELAY_S, atol=0.01)


def test_noise_is_less() -> None:
    rng = np.random.default_rng(4)
    times = np.arange(300) / 30
    noisy = PLACE + 0.02 * rng.normal(size=(300, 3))
    angles, places = filtered(0.05 * rng.normal(size=300), noisy, times)
    assert angles[60:].std() < 0.7 * 0.05
    assert places[60:].std(axis=0).max() < 0.7 * 0.02


def test_the_distance_is_smoothed_more_than_the_place_in_the_image() -> None:
    """A camera measures it less accurately."""
    times = np.arange(600) / 60
    shaking = 0.02 * np.sin(2 * np.pi * 4.0 * times)
    left = []
    for direction in ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]):
        _, places = filtered(
            np.zeros(600), np.array([0.0, 0.0, 4.0]) + np.outer(shaking, direction), times
        )
        left.append((places @ direction)[120:].std())
    assert left[1] < 0.8 * left[0]


def test_after_a_reset_nothing_of_before_is_left() -> None:
    smooth = PoseFilter()
    for t in range(30):
        smooth(exp(1.0 * AXIS)[None], PLACE, t / 30)
    smooth.reset()
    R, place = smooth(exp(-0.5 * AXIS)[None], 2.0 * PLACE, 1.0)
    assert log(R[0]) @ AXIS == pytest.approx(-0.5, abs=1e-9)
    np.testing.assert_allclose(place, 2 * PLACE)
