# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of walls and floors are colours, have the colour that was asked for, and repeat without
a seam.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.benchmarks.scenes.patterns import (
    SIDE,
    boards,
    bricks,
    mottled,
    noise,
    painting,
    stripes,
    tiles,
)

COLOR = np.array([0.4, 0.3, 0.2])


def rng():
    return np.random.default_rng(3)


@pytest.mark.parametrize("make", [boards, bricks, stripes, tiles, lambda r, c: mottled(r, c, 0.1)])
def test_a_picture_has_about_its_colour(make):
    picture = make(rng(), COLOR)
    assert picture.shape == (SIDE, SIDE, 3)
    assert picture.min() > 0
    assert picture.max() <= 0.9
    np.testing.assert_allclose(np.median(picture, axis=(0, 1)), COLOR, rtol=0.35)


def test_a_painting_has_few_colours():
    assert len(np.unique(painting(rng()).reshape(-1, 3), axis=0)) == 5


@pytest.mark.parametrize("stretch", [1.0, 12.0])
def test_noise_has_unit_variance_and_no_seam(stretch):
    values = noise(rng(), 1.2, stretch)
    assert values.std() == pytest.approx(1.0)
    assert values.mean() == pytest.approx(0.0, abs=1e-9)
    for axis in (0, 1):
        step = np.diff(values, axis=axis).std()
        seam = (np.take(values, 0, axis) - np.take(values, -1, axis)).std()
        assert seam < 1.4 * step


def test_stretched_noise_is_smoother_along_the_second_axis():
    values = noise(rng(), 1.0, 12.0)
    assert np.diff(values, axis=1).std() < 0.5 * np.diff(values, axis=0).std()
