# SPDX-License-Identifier: GPL-3.0-or-later
"""A position in the network's input belongs to the image's pixel that is drawn there."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.region import fit_in, halved


@pytest.mark.parametrize("shape", [(120, 60), (60, 120), (40, 40), (333, 500)])
@pytest.mark.parametrize("kind", [{}, {"centered": False}, {"stretched": True}])
def test_positions_lead_back_to_the_marked_place(shape, kind):
    rows, columns = shape
    y, x = np.mgrid[:rows, :columns]
    center = np.array([0.3 * columns, 0.6 * rows])
    blob = np.exp(-((x - center[0]) ** 2 + (y - center[1]) ** 2) / (2 * (0.06 * min(shape)) ** 2))
    image = np.repeat((255 * blob).round().astype(np.uint8)[..., None], 3, axis=2)
    found = fit_in(image, 96, 64, border=0, **kind)
    assert found.picture_rgb.shape == (64, 96, 3)
    weights = found.picture_rgb[..., 0].astype(float)
    v, u = np.mgrid[:64, :96]
    middle = np.array([(weights * (u + 0.5)).sum(), (weights * (v + 0.5)).sum()]) / weights.sum()
    assert found.to_image(middle) == pytest.approx(center, abs=0.6)


def test_the_border_is_where_the_image_is_not():
    image = np.full((10, 20, 3), 200, np.uint8)
    centered = fit_in(image, 40, 40, border=7).picture_rgb
    corner = fit_in(image, 40, 40, border=7, centered=False).picture_rgb
    rows = np.arange(40)[:, None, None]
    assert (centered == np.where((rows >= 10) & (rows < 30), 200, 7)).all()
    assert (corner == np.where(rows < 20, 200, 7)).all()
    assert (fit_in(image, 40, 40, border=7, stretched=True).picture_rgb == 200).all()


def test_small_copies_are_averages_and_have_no_moire():
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (64, 64, 3), dtype=np.uint8)
    averaged = noise.reshape(32, 2, 32, 2, 3).mean(axis=(1, 3))
    assert np.abs(halved(noise).astype(float) - averaged).max() <= 1
    stripes = np.zeros((640, 640, 3), np.uint8)
    stripes[:, ::2] = 255
    small = fit_in(stripes, 50, 50, border=0).picture_rgb
    assert np.ptp(small.astype(int)) <= 6
    assert abs(float(small.mean()) - 127.5) < 3
