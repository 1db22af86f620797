# SPDX-License-Identifier: GPL-3.0-or-later
"""A position in the network's input belongs to the image's pixel that is drawn there."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.region import fit_in


@pytest.mark.parametrize("shape", [(120, 60), (40, 40), (333, 500)])
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
    thin = np.full((1, 500, 3), 200, np.uint8)
    assert (
        fit_in(thin, 40, 40, border=0).picture_rgb.any(axis=2).sum() == 40
    )  # a line of it is left
