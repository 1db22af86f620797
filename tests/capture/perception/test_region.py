# SPDX-License-Identifier: GPL-3.0-or-later
"""The rotated square: analytic positions and rotations, and pixels against the coordinate maps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scope.scope_addon.capture.perception.region import Region, region_from_points

TILTED = Region((320.0, 200.0), 180.0, math.radians(35))


@pytest.mark.parametrize(
    ("top", "rotation_deg"),
    [((50, 80), 180), ((20, 50), -90), ((80, 20), 45)],
)
def test_region_rotates_the_top_point_upright(
    top: tuple[float, float], rotation_deg: float
) -> None:
    region = region_from_points(np.array([50.0, 50.0]), np.array(top, float))
    distance = math.dist((50, 50), top)
    assert math.degrees(region.rotation) == pytest.approx(rotation_deg)
    assert region.side_px == pytest.approx(2.5 * distance)
    np.testing.assert_allclose(region.crop_from_image(np.array([50.0, 50.0])), [0.5, 0.5])
    # 0.5 − 1 / 2.5
    np.testing.assert_allclose(region.crop_from_image(np.array(top, float)), [0.5, 0.1])


@pytest.mark.parametrize(
    ("side", "rotation_deg"), [(90.0, 20), (256.0, -130), (700.0, 0), (1500.0, 20)]
)
def test_cut_agrees_with_the_coordinate_map(side: float, rotation_deg: float) -> None:
    """Large squares included, in which pixels are averaged first."""
    size = 256
    blob = np.array([637.0, 411.0])
    y, x = np.mgrid[:800, :1200]
    sigma = max(2.0, 1.5 * side / size)
    spot = 255 * np.exp(-((x - blob[0]) ** 2 + (y - blob[1]) ** 2) / (2 * sigma**2))
    image = np.repeat(spot[..., None], 3, axis=2).astype(np.uint8)
    region = Region(
        (float(blob[0]) + 0.2 * side, float(blob[1]) - 0.1 * side), side, math.radians(rotation_deg)
    )
    crop = region.cut(image, size)[..., 0].astype(float)
    rows, columns = np.mgrid[:size, :size]
    found = (np.array([(crop * columns).sum(), (crop * rows).sum()]) / crop.sum() + 0.5) / size
    np.testing.assert_allclose(found * size, region.crop_from_image(blob) * size, atol=0.1)


def test_cut_repeats_the_border_pixels_outside_the_image() -> None:
    image = np.full((40, 40, 3), 77, np.uint8)
    for region in (
        Region((0.0, 0.0), 60.0, 0.3),
        Region((-100.0, 20.0), 30.0, 0.0),
        Region((20.0, 20.0), 4000.0, 1.0),
    ):
        assert (region.cut(image, 64) == 77).all()


def test_world_vectors_rotate_with_the_region() -> None:
    quarter = Region((0.0, 0.0), 1.0, math.pi / 2)
    vectors = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    np.testing.assert_allclose(
        quarter.rotate_to_camera(vectors), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-8
    )


def test_resembles() -> None:
    assert TILTED.resembles(Region((330.0, 210.0), 150.0, 0.0), 0.1)
    assert not TILTED.resembles(Region((420.0, 200.0), 180.0, 0.0), 0.5)
    assert not TILTED.resembles(Region((320.0, 200.0), 80.0, 0.0), 0.5)


def test_the_last_bits_of_a_region_do_not_matter() -> None:
    """Versions of numpy differ in them, and a tracker amplifies them."""
    x, y = TILTED.center_px
    slightly = Region((x + 1e-12, y - 1e-12), TILTED.side_px * (1 + 1e-15), TILTED.rotation + 1e-15)
    assert slightly == TILTED
